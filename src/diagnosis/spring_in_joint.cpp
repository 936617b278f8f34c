// SPDX-License-Identifier: Apache-2.0
#include "spring_in_joint.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

constexpr double least_inertia = 1e-4;  // of the joint's largest

}  // namespace

Eigen::MatrixXd spring_torque(const GapMotion& motion, int joint, const SpringInJoint& spring) {
  const Eigen::Index N = motion.samples();
  // Identified base parameters alone may make no inertia in some poses.
  const Eigen::VectorXd of_model = motion.inertia(joint);
  const double largest = of_model.maxCoeff();
  const Eigen::VectorXd inertia = of_model.cwiseMax(largest > 0.0 ? least_inertia * largest : 1.0);
  const Eigen::VectorXd load = motion.rigid.col(joint) - inertia.cwiseProduct(motion.ddq.col(joint));
  const Eigen::VectorXd motor = motion.speed.col(joint), torque = motion.nominal.col(joint);
  const JointFriction& friction = motion.robot().joints[static_cast<std::size_t>(joint)].friction;
  const double dt = 1.0 / motion.rate, half = 0.5 * spring.gap;
  const int steps =
      std::max(2, static_cast<int>(std::ceil(dt * std::sqrt(spring.stiffness / inertia.minCoeff()) / 0.4)));
  // How far the link is behind the motor, and what its friction differs for its speed.
  Eigen::VectorXd behind(N), slip(N);
  double x = std::copysign(half, torque[0]) + torque[0] / spring.stiffness, link = motor[0];
  for (Eigen::Index i = 0; i < N; ++i) {
    const Eigen::Index next = std::min(i + 1, N - 1);
    behind[i] = x;
    slip[i] = friction_torque(friction, link) - friction_torque(friction, motor[i]);
    const double damping = 2.0 * spring.damping_ratio * std::sqrt(spring.stiffness * inertia[i]);
    for (int k = 0; k < steps; ++k) {
      const double part = (k + 1.0) / steps, speed = motor[i] + part * (motor[next] - motor[i]);
      const double pressed = x - std::clamp(x, -half, half);
      double transmitted = pressed == 0.0 ? 0.0 : spring.stiffness * pressed + damping * (speed - link);
      if (half > 0.0 && transmitted * pressed < 0.0) transmitted = 0.0;  // an end pushes, it does not hold
      link += dt / steps / inertia[i] *
              (transmitted - load[i] - part * (load[next] - load[i]) - friction_torque(friction, link));
      x += dt / steps * (speed - link);
    }
  }
  Eigen::MatrixXd out = motion.shifted(joint, -behind);
  out.col(joint) += slip;
  return out;
}

}  // namespace dynid::detail
