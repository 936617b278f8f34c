// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid::detail {

/// The kernels that a plant needs, compiled for 6, 7 and any number of joints. No call allocates or throws.
class RigidBody {
 public:
  virtual ~RigidBody() = default;
  /// M ddq + S dq + g.
  virtual void inverse(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq,
                       Eigen::VectorXd& tau) noexcept = 0;
  virtual void mass(const Eigen::VectorXd& q, Eigen::MatrixXd& M) noexcept = 0;
  /// Poses of the links, and of the tip, in the base frame: n + 1.
  virtual void poses(const Eigen::VectorXd& q, std::vector<Eigen::Isometry3d>& links) noexcept = 0;
  /// Of the tip's origin, in the axes of the base frame: 6 x n.
  virtual void jacobian(const Eigen::VectorXd& q, Eigen::MatrixXd& J) noexcept = 0;

  static std::unique_ptr<RigidBody> make(const Robot& robot);
};

/// Rigid body, rotor inertia and friction: the torque that a model of the robot without effects predicts.
class WholeTorque {
 public:
  explicit WholeTorque(const Robot& robot);
  void operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq,
                  Eigen::VectorXd& tau) noexcept;

 private:
  std::unique_ptr<RigidBody> body_;
  Eigen::VectorXd rotor_;
  std::vector<JointFriction> friction_;
};

/// Friction that jumps is smoothed over this part of a joint's speed (JointScale): a joint that sticks creeps
/// by no more.
inline constexpr double least_velocity_scale = 1e-4;
std::vector<JointFriction> smooth_friction(const Robot& robot);
Eigen::VectorXd rotor_inertias(const Robot& robot);

}  // namespace dynid::detail
