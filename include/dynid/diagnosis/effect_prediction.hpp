// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// The torques that the robot's effects add along a log, at its rows: N x n [N m]; zero without effects.
/// `cutoff` [Hz] of the motion's zero-phase filter, 0: chosen. Allocates. Throws Error where the log has no
/// t, prepare() refuses it, or an effect is not of the catalogue or lacks a parameter.
Eigen::MatrixXd predict_effects(const Robot& robot, const Log& log, double cutoff = 0.0);

}  // namespace dynid
