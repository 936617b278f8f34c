// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

namespace dynid {

/// A position servo: what its joint makes of a commanded position u. Plain data, as a model file carries it.
///
/// With the joint's inertia J, friction and rigid-body load g,
///   J ddq + (kd + fv) dq + Fc sgn dq + g + kp bias = kp (u(t - delay) - q), the right side within the limit.
/// Where the torque is not measured, kp is visible only through a known inertia or gravity. Where it is not
/// known, `kp` is zero and the ratios of the next three members stand in its place; where it is, the Coulomb
/// friction, the viscous friction and the rotor inertia are those of the joint.
struct Servo {
  double kp = 0.0;                 ///< stiffness [N m/rad]; 0: only ratios are known
  double kd = 0.0;                 ///< damping [N m s/rad], where kp is known
  double natural_frequency = 0.0;  ///< sqrt(kp / J) [rad/s], where kp is not known
  double damping_ratio = 0.0;      ///< (kd + fv) / (2 sqrt(kp J)), where kp is not known
  double coulomb_position = 0.0;   ///< Fc / kp [rad], where kp is not known

  double delay = 0.0;              ///< from a command's stamp to its effect [s]
  double bias = 0.0;               ///< u - q at rest without load [rad]
  double stribeck_position = 0.0;  ///< friction at rest above Coulomb friction, over kp [rad]
  double stribeck_velocity = 0.0;  ///< at which it has decayed to 1/e [rad/s]
  double load_friction = 0.0;      ///< friction for each unit of what the servo gives
  double torque_limit = std::numeric_limits<double>::infinity();  ///< [N m], where kp is known
  double error_limit = std::numeric_limits<double>::infinity();   ///< torque limit over kp [rad], where not
  double command_time_constant = 0.0;  ///< of a first-order filter of the command [s]
};

}  // namespace dynid
