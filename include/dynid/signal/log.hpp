// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dynid {

/// What a robot recorded: N samples of n joints, base to tip. A quantity that was not recorded has no rows.
struct Log {
  std::string source;       ///< file, for messages
  Eigen::VectorXd t;        ///< [s] N, strictly increasing but for repeats; empty for samples without time
  Eigen::MatrixXd q;        ///< N x n, joint position [rad or m]
  Eigen::MatrixXd dq;       ///< N x n, joint velocity [rad/s or m/s]
  Eigen::MatrixXd tau;      ///< N x n, joint torque [N m or N]
  Eigen::MatrixXd ddq;      ///< N x n, joint acceleration [rad/s^2], optional
  Eigen::MatrixXd tau_cmd;  ///< N x n, commanded torque [N m], optional
  Eigen::MatrixXd theta;    ///< N x n, motor-side position [rad], optional
  Eigen::MatrixXd temp;     ///< N x n, temperature [deg C], optional
  Eigen::MatrixXd u;        ///< N x n, commanded position of a servo [rad or m], optional

  Eigen::Index samples() const noexcept { return q.rows(); }          ///< N
  int joints() const noexcept { return static_cast<int>(q.cols()); }  ///< n
};

/// Which columns a log must have; the others are read where they stand.
struct LogColumns {
  bool t = true;
  bool dq = true;
  bool tau = true;
};

/// Reads a CSV log (CONTRACT: columns `t, q1..qn, dq1..dqn, tau1..taun` in any order, optional `ddq, tau_cmd,
/// theta, temp, u`; others are ignored). `joints` is n, 0 to take it from the file. Throws Error naming file,
/// line and column for everything that read_table() refuses, a missing column, a number of joints other than
/// n, and time that goes back.
Log read_log(const std::string& path, int joints = 0, const LogColumns& required = {});

/// Writes what the log has as CSV, in the order `t, q.., dq.., tau.., ddq.., tau_cmd.., theta.., temp..,
/// u..`, whole or not at all, every number reading back to the same double. Throws Error naming the path,
/// also on sizes that do not match.
void write_log(const std::string& path, const Log& log);

}  // namespace dynid
