// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_judge.hpp"

namespace dynid::detail {

// What a diagnosis of servo logs says of its logs and its answer.

/// Fills logs and answerable.
void describe_servo_logs(const Robot& nominal, const std::vector<Log>& logs,
                         const std::vector<DataIssue>& issues, Diagnosis& d);
void fill_servo_series(const std::vector<Log>& logs, const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<Eigen::MatrixXd>& after,
                       const std::vector<std::vector<char>>& judging, Diagnosis& d);
/// On the rows that judge; intervals by blocks drawn again.
void shrink_servo(const std::vector<Log>& logs, const std::vector<Eigen::MatrixXd>& before,
                  const std::vector<Eigen::MatrixXd>& after, const std::vector<std::vector<char>>& judging,
                  Diagnosis& d);
void rank_servo_effects(const std::vector<ServoAnswer>& answers, Diagnosis& d);
/// Verdict and judgement from gap, effects and shrink.
void servo_verdict(const ServoCriteria& criteria, Diagnosis& d);
/// Short horizons on the rows that judge.
Rollout servo_rollout(const Robot& nominal, const Robot& patched, const std::vector<Log>& logs,
                      const std::vector<std::vector<char>>& judging);
void servo_next_experiment(Diagnosis& d);

}  // namespace dynid::detail
