// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace dynid {

// What effects are made of in the loop: plain data, joints from 0, torques in N m (N for a prismatic joint).

/// (dq > 0 ? forward : back) exp(-|dq slowness|^exponent) tanh(dq / scale).
struct DryFrictionTerm {
  int joint = 0;
  double forward = 0.0, back = 0.0;
  double slowness = 0.0;  ///< [s/rad] 1 / Stribeck velocity; 0: no fall
  double exponent = 2.0;
  double scale = 1.0;  ///< [rad/s]

  double torque(double dq) const noexcept {
    const double size = (dq > 0.0 ? forward : back) * std::tanh(dq / scale);
    if (slowness == 0.0) return size;
    const double x = std::abs(dq) * slowness;
    return size * std::exp(-(exponent == 2.0 ? x * x : std::pow(x, exponent)));
  }
};

/// amplitude sin(order q + phase).
struct RippleTerm {
  int joint = 0;
  double amplitude = 0.0, order = 0.0, phase = 0.0;

  double torque(double q) const noexcept { return amplitude * std::sin(order * q + phase); }
};

/// coefficient |tau| tanh(dq / scale), tau the torque that passes through the joint, this friction included.
struct LoadFrictionTerm {
  int joint = 0;
  double coefficient = 0.0, scale = 1.0;

  /// Part of the torque `load` that arrives beyond the joint which is lost in it: it takes load (1 + part).
  double part(double dq, double load) const noexcept {
    const double k = coefficient * std::tanh(dq / scale) * (load > 0.0 ? 1.0 : load < 0.0 ? -1.0 : 0.0);
    return k / (1.0 - k);
  }
};

/// Friction and inertia on w = dq_first + ratio dq_second, passed on to the first and, times ratio, to the
/// second joint.
struct ShaftTerm {
  int first = 0, second = 0;
  double ratio = 1.0, viscous = 0.0, coulomb = 0.0, inertia = 0.0, scale = 1.0;

  double friction(double w) const noexcept { return viscous * w + coulomb * std::tanh(w / scale); }
};

/// Of all effects of a robot: filled by EffectSchema::compile.
struct LoopTerms {
  explicit LoopTerms(int n = 0) : stiffness(Eigen::VectorXd::Zero(n)), offset(stiffness), gain(stiffness) {}

  Eigen::VectorXd stiffness;  ///< n: stiffness q [N m/rad]
  Eigen::VectorXd offset;     ///< n [N m]
  Eigen::VectorXd gain;       ///< n: the sensor reads (1 + gain) times rigid body and friction laws
  std::vector<DryFrictionTerm> dry;
  std::vector<RippleTerm> ripple;
  std::vector<LoadFrictionTerm> load;
  std::vector<ShaftTerm> shafts;
};

}  // namespace dynid
