// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

#include "dynid/friction/parameter.hpp"

namespace dynid {

/// sign(dq), or tanh(dq / v_s) where a velocity scale v_s > 0 [rad/s] is given; 0 at rest.
inline double smooth_sign(double dq, double velocity_scale) noexcept {
  if (velocity_scale > 0.0) return std::tanh(dq / velocity_scale);
  return dq > 0.0 ? 1.0 : (dq < 0.0 ? -1.0 : 0.0);
}

/// Eq. (24): tau_f = fv dq + fc sign(dq) + fo.
struct LinearFriction {
  double viscous = 0.0;         ///< fv [N m s/rad]
  double coulomb = 0.0;         ///< fc [N m]
  double offset = 0.0;          ///< fo [N m]
  double velocity_scale = 0.0;  ///< v_s [rad/s]: sign(dq) is read as tanh(dq / v_s); 0 is the exact sign

  static constexpr const char* name = "linear";
  static constexpr const char* equation = "eq. (24)";
  static constexpr const char* formula = "viscous dq + coulomb sign(dq) + offset";
  /// Whether a model file gives all of its keys or none; else one left out is zero.
  static constexpr bool all_or_none = false;

  static constexpr auto parameters() noexcept {
    using P = FrictionParameter<LinearFriction>;
    return std::array<P, 4>{P{"viscous", "fv", &LinearFriction::viscous},
                            P{"coulomb", "fc", &LinearFriction::coulomb},
                            P{"offset", "fo", &LinearFriction::offset},
                            P{"velocity_scale", "", &LinearFriction::velocity_scale, FrictionRole::given}};
  }

  /// [N m] at joint velocity dq [rad/s].
  double torque(double dq) const noexcept {
    return viscous * dq + coulomb * smooth_sign(dq, velocity_scale) + offset;
  }

  /// d tau_f / d dq [N m s/rad]; where the exact sign jumps, its slope is left out.
  double slope(double dq) const noexcept {
    if (!(velocity_scale > 0.0)) return viscous;
    const double s = std::tanh(dq / velocity_scale);
    return viscous + coulomb * (1.0 - s * s) / velocity_scale;
  }

  /// d tau_f / d(fv, fc, fo): the row that eq. (24) adds to the regressor.
  Eigen::RowVector3d regressor(double dq) const noexcept {
    return {dq, smooth_sign(dq, velocity_scale), 1.0};
  }
};

}  // namespace dynid
