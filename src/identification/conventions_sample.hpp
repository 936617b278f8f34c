// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "dynid/dynamics/packet.hpp"
#include "dynid/model/robot.hpp"
#include "signal/spread_rows.hpp"

namespace dynid::detail {

/// A way to read a log, as the search tries it. Joints from 0.
struct Reading {
  std::vector<int> order;                   ///< joint j is the log's column order[j]
  Eigen::VectorXd sign, torque_sign, zero;  ///< n; see Assumptions
  Eigen::VectorXd factor;                   ///< n [N m per unit of the log's torque]
  double position_unit = 1.0;               ///< of revolute joints
  double time_unit = 1.0;                   ///< [s] that one of the log's is
  Eigen::Vector3d gravity;                  ///< [m/s^2]
  bool without_gravity = false, magnitude = false, turned_gravity = false;
  bool unit_of_torque = false;  ///< `factor` is that of a known unit
  double complexity = 0.0;      ///< what it costs to believe it, in the measure of score()
};

/// Some rows of a log and what of a joint's torque its own friction cannot be.
class ConventionSample {
 public:
  /// The first `count` rows (a multiple of eight, or fewer). `inertia`: n, largest rotor inertia to believe.
  ConventionSample(const Robot& robot, const SpreadRows& rows, Eigen::Index count,
                   const Eigen::VectorXd& most_rotor);

  int joints() const { return n_; }
  Eigen::Index rows() const { return 8 * blocks_; }
  /// Motion of every joint under a reading: [block * n + joint].
  void motion(const Reading& reading, std::vector<Packet8>& q, std::vector<Packet8>& dq,
              std::vector<Packet8>& ddq) const;
  /// Energy of column k's torque that an offset, Coulomb and viscous friction cannot be.
  double energy(int k) const { return energy_[k]; }
  /// Part of it that a rotor inertia, none of these coefficients negative, cannot be either, whichever way
  /// the torque is turned: what only a rigid body explains.
  double bodyless(int k) const { return bodyless_[k]; }
  /// Part of it that is left once `T` (of joint j under the reading) is taken off and offset, friction and
  /// rotor inertia, not negative, are fitted.
  double residual(const Reading& reading, int j, const Eigen::MatrixXd& T, double torque_sign,
                  double factor) const;
  /// Of what offset and friction alone leave of the torque, the part that is left with T taken off too, no
  /// rotor inertia fitted to either.
  double bare_part(const Reading& reading, int j, const Eigen::MatrixXd& T) const;
  /// As residual(), friction and rotor of either sign: the quick bound that searches use.
  double quick_residual(int j, int k, const Eigen::MatrixXd& T, double torque_sign) const;
  /// Factor a with torque of column k = a T_j + friction; and the correlation.
  double scale(int k, int j, const Eigen::MatrixXd& T, double& correlation) const;
  /// X less its part along offset, friction and rotor columns of column k.
  void project(int k, Eigen::Ref<Eigen::MatrixXd> X) const;
  const Eigen::MatrixXd& torque() const { return tau_; }        ///< as logged
  const Eigen::MatrixXd& bare_torque() const { return bare_; }  ///< projected
  /// The friction and rotor torque fitted in residual(), rows of joint j.
  Eigen::VectorXd fitted(const Reading& reading, int j, const Eigen::VectorXd& residual) const;

 private:
  Eigen::Vector3d fit(const Reading& reading, int j, const Eigen::VectorXd& r, double most_rotor,
                      double& left) const;

  int n_ = 0;
  Eigen::Index blocks_ = 0;
  std::vector<bool> revolute_;
  std::vector<Packet8> q_, dq_, ddq_;
  Eigen::MatrixXd tau_, bare_;
  Eigen::VectorXd energy_, bodyless_, most_rotor_;
  std::vector<Eigen::MatrixXd> basis_;     // orthonormal: offset, Coulomb, viscous, rotor
  std::vector<Eigen::MatrixXd> friction_;  // centred columns: Coulomb, viscous, rotor
  std::vector<Eigen::Matrix3d> gram_;
};

/// The kernels, compiled for the robot's number of joints.
class NominalKernel {
 public:
  virtual ~NominalKernel() = default;
  /// rows x n, whole torque under gravity g.
  virtual void torque(const ConventionSample& sample, const Reading& reading, const Eigen::Vector3d& g,
                      Eigen::MatrixXd& out) = 0;
  /// Ten columns of a link, from 0, for every row and joint: out[j] is rows x 10.
  virtual void link(const ConventionSample& sample, const Reading& reading, int link,
                    std::vector<Eigen::MatrixXd>& out) = 0;
};
std::unique_ptr<NominalKernel> make_kernel(const Robot& robot);

}  // namespace dynid::detail
