// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// replay_servos(), set to the measured state (the log's q, and `dq`, N x n [rad/s]) at each of the rows
/// `starts` (increasing) anew: the positions, N x n [rad]; before the first start the log's. Throws Error as
/// replay_servos() does.
Eigen::MatrixXd replay_servos_from(const Robot& robot, const Log& log, const Eigen::MatrixXd& dq,
                                   const std::vector<Eigen::Index>& starts, int substeps = 16);

}  // namespace dynid
