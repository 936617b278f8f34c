// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/friction/joint_friction.hpp"

namespace dynid {

// The laws as functions: `law` is any friction law, or the JointFriction that is their sum. Neither allocates
// nor throws.

/// Friction torque [N m] at joint velocity dq [rad/s], on the motor's side of the balance: tau = M ddq + c +
/// g + tau_f.
template <class Law>
double friction_torque(const Law& law, double dq) noexcept {
  return law.torque(dq);
}

/// d tau_f / d dq [N m s/rad].
template <class Law>
double friction_slope(const Law& law, double dq) noexcept {
  return law.slope(dq);
}

/// d tau_f / d(parameters that are not given), of one law: a row.
template <class Law>
auto friction_regressor(const Law& law, double dq) noexcept {
  return law.regressor(dq);
}

}  // namespace dynid
