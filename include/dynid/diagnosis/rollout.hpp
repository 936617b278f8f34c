// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace dynid {

/// The motion that models make of the measured torques over short horizons, from measured states on: what a
/// user of a simulator sees. K horizons; empty where a model has no motion (a mass matrix that is singular).
struct Rollout {
  Eigen::VectorXd horizon;  ///< K [s]
  /// K [rad]: error at the horizon's end without and with the effects, rms over joints, median over starts (a
  /// light joint that runs away from one of them says nothing about the rest).
  Eigen::VectorXd before, after;
  // The longest horizon replayed again and again, every time from the measured state: N rows.
  int log = 0;              ///< that was replayed, from 0
  Eigen::VectorXd t;        ///< N [s] since the log's start
  Eigen::VectorXi start;    ///< N: which start the row belongs to
  Eigen::MatrixXd q;        ///< N x n [rad], measured
  Eigen::MatrixXd without;  ///< N x n [rad], replayed by the nominal model
  Eigen::MatrixXd with;     ///< N x n [rad], replayed with the effects
};

}  // namespace dynid
