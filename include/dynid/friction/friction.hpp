// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "dynid/model/friction_parameters.hpp"

namespace dynid {

/// sign(dq), or tanh(dq / v_s) where a velocity scale v_s > 0 [rad/s] is given; 0 at rest.
inline double smooth_sign(double dq, double velocity_scale) noexcept {
  if (velocity_scale > 0.0) return std::tanh(dq / velocity_scale);
  return dq > 0.0 ? 1.0 : (dq < 0.0 ? -1.0 : 0.0);
}

/// 1 / (1 + exp(-x)), without overflow for any x.
inline double logistic(double x) noexcept {
  const double e = std::exp(-std::abs(x));
  return x >= 0.0 ? 1.0 / (1.0 + e) : e / (1.0 + e);
}

/// Eq. (24) [N m] at joint velocity dq [rad/s].
inline double friction_torque(const LinearFriction& f, double dq) noexcept {
  return f.viscous * dq + f.coulomb * smooth_sign(dq, f.velocity_scale) + f.offset;
}

/// Eq. (25) [N m] at joint velocity dq [rad/s].
inline double friction_torque(const SigmoidFriction& f, double dq) noexcept {
  return f.phi1 * (logistic(f.phi2 * (dq + f.phi3)) - logistic(f.phi2 * f.phi3));
}

/// Friction torque of a joint [N m], on the motor's side of the balance: tau = M ddq + c + g + tau_f.
inline double friction_torque(const JointFriction& f, double dq) noexcept {
  return friction_torque(f.linear, dq) + friction_torque(f.sigmoid, dq);
}

/// d tau_f / d(fv, fc, fo): the row that eq. (24) adds to the regressor.
inline Eigen::RowVector3d friction_regressor(const LinearFriction& f, double dq) noexcept {
  return {dq, smooth_sign(dq, f.velocity_scale), 1.0};
}

/// d tau_f / d(phi1, phi2, phi3) of eq. (25), which is linear in phi1 only.
inline Eigen::RowVector3d friction_regressor(const SigmoidFriction& f, double dq) noexcept {
  const double at = logistic(f.phi2 * (dq + f.phi3)), rest = logistic(f.phi2 * f.phi3);
  const double at_slope = at * (1.0 - at), rest_slope = rest * (1.0 - rest);
  return {at - rest, f.phi1 * (at_slope * (dq + f.phi3) - rest_slope * f.phi3),
          f.phi1 * f.phi2 * (at_slope - rest_slope)};
}

/// d tau_f / d dq [N m s/rad] of eq. (24); where the exact sign jumps, its slope is left out.
inline double friction_slope(const LinearFriction& f, double dq) noexcept {
  if (!(f.velocity_scale > 0.0)) return f.viscous;
  const double s = std::tanh(dq / f.velocity_scale);
  return f.viscous + f.coulomb * (1.0 - s * s) / f.velocity_scale;
}

/// d tau_f / d dq [N m s/rad] of eq. (25).
inline double friction_slope(const SigmoidFriction& f, double dq) noexcept {
  const double at = logistic(f.phi2 * (dq + f.phi3));
  return f.phi1 * f.phi2 * at * (1.0 - at);
}

/// d tau_f / d dq [N m s/rad] of both laws.
inline double friction_slope(const JointFriction& f, double dq) noexcept {
  return friction_slope(f.linear, dq) + friction_slope(f.sigmoid, dq);
}

}  // namespace dynid
