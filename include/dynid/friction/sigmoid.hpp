// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

#include "dynid/friction/parameter.hpp"

namespace dynid {

/// 1 / (1 + exp(-x)), without overflow for any x.
inline double logistic(double x) noexcept {
  const double e = std::exp(-std::abs(x));
  return x >= 0.0 ? 1.0 / (1.0 + e) : e / (1.0 + e);
}

/// Eq. (25): tau_f = phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)).
struct SigmoidFriction {
  double phi1 = 0.0;  ///< [N m]
  double phi2 = 0.0;  ///< [s/rad]
  double phi3 = 0.0;  ///< [rad/s]

  static constexpr const char* name = "sigmoid";
  static constexpr const char* equation = "eq. (25)";
  static constexpr const char* formula = "phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3))";
  static constexpr bool all_or_none = true;

  /// Searched: from nearly straight over the velocities seen (phi2 fastest = 0.3) to a step between two of
  /// them (900), with the middle of the curve anywhere among them, denser near zero, where the curve bends.
  static constexpr auto parameters() noexcept {
    using P = FrictionParameter<SigmoidFriction>;
    return std::array<P, 3>{P{"phi1", "phi1_", &SigmoidFriction::phi1},
                            P{"phi2", "phi2_", &SigmoidFriction::phi2, FrictionRole::nonlinear, -1, 0.3,
                              900.0, FrictionSpacing::geometric, 28},
                            P{"phi3", "phi3_", &SigmoidFriction::phi3, FrictionRole::nonlinear, 1, -1.0, 1.0,
                              FrictionSpacing::dense_near_zero, 25}};
  }

  /// [N m] at joint velocity dq [rad/s]; 0 at rest.
  double torque(double dq) const noexcept {
    return phi1 * (logistic(phi2 * (dq + phi3)) - logistic(phi2 * phi3));
  }

  /// d tau_f / d dq [N m s/rad].
  double slope(double dq) const noexcept {
    const double at = logistic(phi2 * (dq + phi3));
    return phi1 * phi2 * at * (1.0 - at);
  }

  /// d tau_f / d(phi1, phi2, phi3), of which the torque is linear in phi1 only.
  Eigen::RowVector3d regressor(double dq) const noexcept {
    const double at = logistic(phi2 * (dq + phi3)), rest = logistic(phi2 * phi3);
    const double at_slope = at * (1.0 - at), rest_slope = rest * (1.0 - rest);
    return {at - rest, phi1 * (at_slope * (dq + phi3) - rest_slope * phi3),
            phi1 * phi2 * (at_slope - rest_slope)};
  }
};

}  // namespace dynid
