// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
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
  GapMotion(const Robot& nominal, Segment segment, double start);
  /// `count` samples from `first` on, as a stretch of its own.
  GapMotion part(Eigen::Index first, Eigen::Index count) const;

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
  Eigen::MatrixXd known;    ///< N x n [N m], of that the effects the model names; empty: it names none
  Eigen::MatrixXd rigid;    ///< N x n [N m], without friction
  Eigen::VectorXd worked;   ///< n [rad^2/s]: integral of the squared speed from the log's start to here

  /// Columns that standard parameters of link `link` (from 0) have in the joints up to it: N x 10 each.
  /// Computed anew with every call: stored, those of all links would be ten times as large as all the rest.
  std::vector<Eigen::MatrixXd> link_columns(int link) const;
  /// The same of all links in all joints, of `count` samples from `first` on: of each joint, count x 10 n.
  std::vector<Eigen::MatrixXd> regressor_rows(Eigen::Index first, Eigen::Index count) const;
  /// Derivative of the rigid body's torque along a change of the motion (N x n each, in the units of q, dq,
  /// ddq): N x n [N m].
  Eigen::MatrixXd along(const Eigen::MatrixXd& d_q, const Eigen::MatrixXd& d_dq,
                        const Eigen::MatrixXd& d_ddq) const;
  /// The same along one joint's own change `d` (N) [rad] over time, and its derivatives: N x n [N m].
  Eigen::MatrixXd shifted(int joint, const Eigen::VectorXd& d) const;
  /// M_jj along the motion: N [kg m^2].
  Eigen::VectorXd inertia(int joint) const;
  /// Makes what shifted() and inertia() of all joints share, 3 n^2 N numbers, and the links' poses that
  /// force_columns() needs, 12 n N numbers: worth it where they are called often. Without it each call
  /// computes what it needs. Not while another thread uses the motion.
  void keep_shared() const;
  /// What a gravity vector [m/s^2], in the base frame, adds to the rigid body's torque: N x n [N m].
  Eigen::MatrixXd gravity_columns(const Eigen::Vector3d& gravity) const;
  /// J^T of a point [m] fixed in link `link` (from 0), in the link frame, for a force in the axes of the base
  /// frame, of `count` samples from `first` on: of each joint up to the link, count x 3.
  std::vector<Eigen::MatrixXd> force_columns(int link, const Eigen::Vector3d& point, Eigen::Index first,
                                             Eigen::Index count) const;

 private:
  GapMotion(const GapMotion& of, Eigen::Index first, Eigen::Index count);
  Robot robot_;
  Model<> model_;
  using Slopes = std::array<Eigen::MatrixXd, 3>;  // d tau / d (q_j, dq_j, ddq_j), N x n each
  mutable std::vector<Slopes> slopes_;            // of each joint; empty: not kept
  using Pose = Eigen::Transform<double, 3, Eigen::AffineCompact>;
  std::vector<Pose> poses(Eigen::Index first, Eigen::Index count) const;  // sample by sample, base to tip
  mutable std::vector<Pose> poses_;  // of each sample, of each link; empty: not kept
};

/// Columns that one effect has in some of the joints' torques.
struct ColumnBlock {
  std::vector<int> channels;            ///< joints (from 0), increasing
  std::vector<Eigen::MatrixXd> values;  ///< of each channel: N x coefficients
};

}  // namespace dynid
