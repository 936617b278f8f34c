// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dynid {

/// The gap over time, in the rows that the diagnosis works on: low-passed and decimated. N rows.
struct GapSeries {
  std::vector<int> log;        ///< N: of each row, from 0
  Eigen::VectorXd t;           ///< N [s] since the log's start
  Eigen::MatrixXd before;      ///< N x n [N m]: measured less nominal torque
  Eigen::MatrixXd after;       ///< N x n [N m]: less the effects too, fitted where `held_out` is false
  std::vector<bool> held_out;  ///< N: the row took no part in choosing or fitting
};

}  // namespace dynid
