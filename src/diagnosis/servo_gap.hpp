// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_joint_fit.hpp"

namespace dynid::detail {

/// Which rows of each log judge and choose nothing: the last of several logs, or the last third of each half
/// of one.
std::vector<std::vector<char>> judging_rows(const std::vector<Log>& logs);

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

}  // namespace dynid::detail
