// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_joint_fit.hpp"

namespace dynid::detail {

/// Which rows of each log judge and choose nothing: the last of several logs, or, `spread`, the last third of
/// each half of each log; so of a log alone.
std::vector<std::vector<char>> judging_rows(const std::vector<Log>& logs, bool spread);

/// Standard deviation of a joint's measured position [rad or m]: of rounding to the encoder's step, or of
/// what does not follow from sample to sample; 0 where neither command nor position ever moves.
double position_floor(const std::vector<ServoSeries>& series);

KnobScale knob_scale(const std::vector<ServoSeries>& series);

/// A joint with whole logs (`most_rows` 0), or with windows of them of so many rows together. `floor`: the
/// joint's position_floor(), or what stands in for it.
ServoProblemOfJoint joint_problem(const Robot& nominal, int joint, const std::vector<ServoSeries>& series,
                                  const std::vector<std::vector<char>>& judging,
                                  const DiagnoseServosOptions& options, double floor, int most_rows);

/// Fills rms, floor, tolerance, upper, p_value, where of the diagnosis from the motion error `before` of each
/// log (N x n).
void measure_servo_gap(const std::vector<Log>& logs, const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<ServoProblemOfJoint>& joints, Diagnosis& d);

/// A joint has a gap (measure_servo_gap() is done) in the rows that fit and in those that judge, each by
/// itself: else what is found in the ones can say nothing of the others.
bool gap_shows_on_both(const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<std::vector<char>>& judging, const Diagnosis& d, double detection);

}  // namespace dynid::detail
