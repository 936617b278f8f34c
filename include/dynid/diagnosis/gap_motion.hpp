// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "dynid/dynamics/model.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

/// A stretch of a prepared log, with what the nominal model says along it: what effects are computed from.
class GapMotion {
 public:
  /// `start` [s]: the log's first stamp. Throws Error where Model does.
  GapMotion(const Robot& nominal, const Segment& segment, double start);

  const Robot& robot() const noexcept { return robot_; }
  int joints() const noexcept { return robot_.size(); }       ///< n
  Eigen::Index samples() const noexcept { return q.rows(); }  ///< N
  double rate = 0.0;                                          ///< [Hz]
  double start = 0.0;                                         ///< [s] of the log, as it is stamped
  Eigen::VectorXd t;                                          ///< N [s] since the log's start
  Eigen::MatrixXd q, dq, ddq;                                 ///< N x n, low-passed
  Eigen::MatrixXd speed;    ///< N x n [rad/s], in a wider band where the segment has it: for friction
  Eigen::MatrixXd tau;      ///< N x n [N m], as measured
  Eigen::MatrixXd nominal;  ///< N x n [N m], the whole nominal model
  Eigen::MatrixXd rigid;    ///< N x n [N m], without friction

  /// Columns that standard parameters of link `link` (from 0) have in joint `joint` (from 0): N x 10.
  Eigen::MatrixXd link_columns(int link, int joint) const;
  /// Derivative of the rigid body's torque along a change of the motion (N x n each, in the units of q, dq,
  /// ddq): N x n [N m].
  Eigen::MatrixXd along(const Eigen::MatrixXd& d_q, const Eigen::MatrixXd& d_dq,
                        const Eigen::MatrixXd& d_ddq) const;
  /// The same along one joint's own change `d` (N) [rad] over time, and its derivatives: N x n [N m]. The
  /// first call for any joint makes what all share: not from two threads at once.
  Eigen::MatrixXd shifted(int joint, const Eigen::VectorXd& d) const;
  /// M_jj along the motion: N [kg m^2]. As shifted().
  Eigen::VectorXd inertia(int joint) const;
  /// What a gravity vector [m/s^2], in the base frame, adds to the rigid body's torque: N x n [N m].
  Eigen::MatrixXd gravity_columns(const Eigen::Vector3d& gravity) const;
  /// J^T of a point [m] fixed in link `link` (from 0), in the link frame, for a force in the axes of the base
  /// frame: rows of joint `joint`, N x 3. The first call makes what all share: not from two threads at once.
  Eigen::MatrixXd force_columns(int link, const Eigen::Vector3d& point, int joint) const;

 private:
  Robot robot_;
  Model<> model_;
  std::vector<Eigen::MatrixXd> regressor_;  // joint by joint, N x 10 n
  // Link, joint: J^T of the link's origin, then what each unit of the point's coordinates adds: N x 12.
  mutable std::vector<std::vector<Eigen::MatrixXd>> force_;
  using Slopes = std::array<Eigen::MatrixXd, 3>;  // d tau / d (q_j, dq_j, ddq_j), N x n each
  mutable std::vector<Slopes> slopes_;            // of each joint
  const Slopes& slopes(int joint) const;
};

/// Columns that one effect has in some of the joints' torques.
struct ColumnBlock {
  std::vector<int> channels;            ///< joints (from 0), increasing
  std::vector<Eigen::MatrixXd> values;  ///< of each channel: N x coefficients
};

}  // namespace dynid
