// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dynid {

/// A motion as samples: N instants of n joints, base to tip.
struct Trajectory {
  std::string source;   ///< file, for messages
  Eigen::VectorXd t;    ///< [s] N, strictly increasing
  Eigen::MatrixXd q;    ///< N x n [rad or m]
  Eigen::MatrixXd dq;   ///< N x n [rad/s or m/s]
  Eigen::MatrixXd ddq;  ///< N x n [rad/s^2 or m/s^2]

  Eigen::Index samples() const noexcept { return q.rows(); }          ///< N
  int joints() const noexcept { return static_cast<int>(q.cols()); }  ///< n
};

/// Reads CSV `t, q1..qn, dq1..dqn, ddq1..ddqn` (columns in any order, others are ignored). Where dq or ddq is
/// absent it is the derivative of q or dq, by the parabola through three neighbouring samples. `joints` is n,
/// 0 to take it from the file. Throws Error naming file, line and column for everything that read_table()
/// refuses, a missing column, another number of joints, fewer than two samples (three where a derivative has
/// to be found) and time that does not increase.
Trajectory read_trajectory(const std::string& path, int joints = 0);

/// Writes CSV `t, q1.., dq1.., ddq1..`, whole or not at all, every number reading back to the same double.
/// Throws Error naming the path, also on sizes that do not match.
void write_trajectory(const std::string& path, const Trajectory& trajectory);

/// The same motion as a `trajectory_msgs/JointTrajectory` message in YAML, as `rostopic pub -f` takes it:
/// time_from_start counts from the first sample, numbers have nine decimals, the stamp is zero (start at
/// once). Throws Error unless there is one joint name a joint.
std::string to_joint_trajectory(const Trajectory& trajectory, const std::vector<std::string>& joint_names);

/// State at time `t` [s]: between samples the quintic that has q, dq and ddq of both neighbours; before the
/// first and after the last sample, the position there, at rest. Outputs: n; does not allocate where they
/// have that size already. The trajectory has at least one sample.
void sample(const Trajectory& trajectory, double t, Eigen::VectorXd& q, Eigen::VectorXd& dq,
            Eigen::VectorXd& ddq);

}  // namespace dynid
