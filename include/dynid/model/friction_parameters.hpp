// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// Laws that `--friction` names.
enum class FrictionLaw {
  none,
  linear,   ///< eq. (24): viscous, Coulomb, offset
  sigmoid,  ///< eq. (25)
};

/// Eq. (24): tau_f = fv dq + fc sign(dq) + fo.
struct LinearFriction {
  double viscous = 0.0;         ///< fv [N m s/rad]
  double coulomb = 0.0;         ///< fc [N m]
  double offset = 0.0;          ///< fo [N m]
  double velocity_scale = 0.0;  ///< v_s [rad/s]: sign(dq) is read as tanh(dq / v_s); 0 is the exact sign
};

/// Eq. (25): tau_f = phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)).
struct SigmoidFriction {
  double phi1 = 0.0;  ///< [N m]
  double phi2 = 0.0;  ///< [s/rad]
  double phi3 = 0.0;  ///< [rad/s]
};

/// Friction of one joint: the sum of both laws, either of which may be zero.
struct JointFriction {
  LinearFriction linear;
  SigmoidFriction sigmoid;
};

}  // namespace dynid
