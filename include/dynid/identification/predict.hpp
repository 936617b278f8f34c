// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// Torques of a model along a motion, one row a sample.
struct PredictedTorque {
  Eigen::VectorXd t;      ///< [s] N; the sample's number from 0 where the log has no time
  Eigen::MatrixXd tau;    ///< [N m] N x n: rigid body, rotor inertia and friction
  Eigen::MatrixXd tau_f;  ///< [N m] N x n: friction alone
};

/// Torques at given motions (N x n each; rad, rad/s, rad/s^2). Throws Error on sizes that do not match the
/// robot.
PredictedTorque predict_torque(const Robot& robot, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                               const Eigen::MatrixXd& ddq);

/// Torques at the rows of a log. Where it has ddq, its q, dq and ddq are used as they stand; else the log is
/// prepared (repeats, lag, filter at `cutoff` [Hz], 0: chosen; differentiation) and read off at its own
/// stamps. Throws Error naming the log.
PredictedTorque predict_torque(const Robot& robot, const Log& log, double cutoff = 0.0);

}  // namespace dynid
