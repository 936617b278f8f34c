// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/dynamics/servo_joint.hpp"
#include "dynid/identification/servo.hpp"

namespace dynid::detail {

/// One joint in one log (or a part of it), ready to be simulated.
struct ServoSeries {
  Eigen::VectorXd t, u, q;        ///< N
  Eigen::VectorXd inertia, load;  ///< N: M_jj and the rest of the rigid body's torque; empty without one
  Eigen::VectorXd gravity;        ///< N: the part of `load` that is gravity's
  /// N x k: parts of `load` that may have factors of their own; empty without.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> parts;
  double interval = 0.0;    ///< median of the stamps' [s]
  double resolution = 0.0;  ///< smallest change of q, an encoder's step [rad]
  double v0 = 0.0;          ///< velocity at the first stamp, where it is known [rad/s]
  HeldCommand command;
  int log = 0;  ///< that it is of

  ServoSeries(Eigen::VectorXd t_, Eigen::VectorXd u_, Eigen::VectorXd q_)
      : t(std::move(t_)), u(std::move(u_)), q(std::move(q_)), command(t, u) {}
};

/// Checks the logs and throws Error, or adds to `issues`, what is wrong with them.
void check_servo_logs(const std::vector<Log>& logs, const std::optional<Robot>& robot,
                      std::vector<DataIssue>& issues);

/// By joint, then by log.
std::vector<std::vector<ServoSeries>> servo_series(const std::vector<Log>& logs,
                                                   const std::optional<Robot>& robot);

/// Measured motion on an even grid, low-passed without phase, with its derivatives.
struct SmoothMotion {
  Eigen::VectorXd t;        ///< K, the grid [s]
  Eigen::MatrixXd q, v, a;  ///< K x n
};
SmoothMotion smooth_motion(const Log& log, double interval);

/// servo_ratios() of joint `joint` (from 0), with the robot's effects there: the gap of its backlash, and,
/// where kp is known, its springs (joint_spring).
ServoJoint servo_joint(const Robot& robot, int joint);

/// Rows [first, first + count) of a series as one of its own.
ServoSeries part_of(const ServoSeries& series, Eigen::Index first, Eigen::Index count);

}  // namespace dynid::detail
