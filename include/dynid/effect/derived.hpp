// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "dynid/effect/schema.hpp"

namespace dynid {

// What one form of an effect says in the words of another, and what stands behind its parameters. Effects are
// complete (complete_effect(), checked_effect()), joints from 0, unless something else is said.

/// Number of joint `joint` of a joint's own parameter; `absent` where the effect has no such parameter.
inline double joint_number(const Effect& effect, const char* key, int joint, double absent = 0.0) noexcept {
  const auto found = effect.parameters.find(key);
  const auto at = static_cast<std::size_t>(joint);
  return found == effect.parameters.end() || at >= found->second.size() ? absent : found->second[at];
}
/// First number of a parameter, and its first three.
inline double first_number(const Effect& effect, const char* key) {
  return effect.parameters.at(key).front();
}
inline Eigen::Vector3d three_numbers(const Effect& effect, const char* key) {
  return Eigen::Map<const Eigen::Vector3d>(effect.parameters.at(key).data());
}

/// presliding_hysteresis: the bristle's stiffness [N m/rad] is coulomb / slip where slip is given, and the
/// slip [rad] is coulomb / stiffness where that is.
inline double bristle_stiffness(const Effect& effect, int joint) noexcept {
  const double slip = joint_number(effect, "slip", joint);
  return slip > 0.0 ? joint_number(effect, "coulomb", joint) / slip
                    : joint_number(effect, "stiffness", joint);
}
inline double bristle_slip(const Effect& effect, int joint) noexcept {
  const double stiffness = joint_number(effect, "stiffness", joint),
               slip = joint_number(effect, "slip", joint);
  return slip > 0.0 || !(stiffness > 0.0) ? slip : joint_number(effect, "coulomb", joint) / stiffness;
}

/// thermal_friction_drift as T dw/dt = (dq / v)^2 - w; v = 0: the joint warms by the clock, T dw/dt = 1 - w.
struct Warming {
  double time_constant = 1.0;    ///< T [s]
  double reference_speed = 0.0;  ///< v [rad/s]
};

/// Where motion_constant H0 is given, friction falls with exp(-H / H0), H the integral of dq^2. The one that
/// warms straight has lost as much in the end where v^2 T = 2 H0; T is too long then for it to cool down.
inline Warming warming(const Effect& effect, int joint) noexcept {
  constexpr double slow = 1e3;  // [s]
  const double motion = joint_number(effect, "motion_constant", joint);
  if (motion > 0.0) return {slow, std::sqrt(2.0 * motion / slow)};
  return {joint_number(effect, "time_constant", joint, 1.0), joint_number(effect, "reference_speed", joint)};
}
/// And the other way: H0 [rad^2/s], 0 where it warms by the clock.
inline double motion_constant(const Effect& effect, int joint) noexcept {
  const double own = joint_number(effect, "motion_constant", joint);
  if (own > 0.0) return own;
  const Warming w = warming(effect, joint);
  return 0.5 * w.time_constant * w.reference_speed * w.reference_speed;
}

/// payload: the body in the frame of the last link. Its com is given in the frame of the tip with radius (a
/// solid ball), and in that of the last link with inertia (xx, xy, xz, yy, yz, zz about com).
inline StandardParameters payload_body(const Robot& robot, const Effect& effect) {
  LinkInertia body;
  body.mass = first_number(effect, "mass");
  body.com = three_numbers(effect, "com");
  if (effect.parameters.count("inertia") > 0) {
    const std::vector<double>& i = effect.parameters.at("inertia");
    body.inertia << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
    return to_standard(body);
  }
  const double radius = first_number(effect, "radius");
  body.inertia = 0.4 * body.mass * radius * radius * Eigen::Matrix3d::Identity();
  return transformed(to_standard(body), robot.tip);
}

/// link_inertial_error: what it adds to the ten standard parameters of the link, by either form.
inline StandardParameters link_change(const StandardParameters& link, const Effect& effect) {
  if (effect.parameters.count("first_moment") > 0) {
    StandardParameters change;
    change[0] = first_number(effect, "mass");
    change.segment<3>(1) = three_numbers(effect, "first_moment");
    const std::vector<double>& i = effect.parameters.at("inertia_about_origin");
    for (int k = 0; k < 6; ++k) change[4 + k] = i[static_cast<std::size_t>(k)];
    return change;
  }
  LinkInertia body = from_standard(link);
  body.mass += first_number(effect, "mass");
  body.com += three_numbers(effect, "com");
  body.inertia *= 1.0 + first_number(effect, "inertia");
  return to_standard(body) - link;
}

/// Two unit vectors across gravity, as near to the x and y axes of the base as can be: where gravity points
/// down along z, they are these.
inline Eigen::Matrix<double, 3, 2> across_gravity(const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d down = gravity.normalized();
  Eigen::Vector3d x = Eigen::Vector3d::UnitX() - down * down.x();
  if (x.norm() < 0.1) x = Eigen::Vector3d::UnitZ() - down * down.z();
  x.normalize();
  Eigen::Matrix<double, 3, 2> both;
  both << x, (-down).cross(x);
  return both;
}

/// gravity_tilt: the turn of gravity. Its axis lies across gravity, by direction_deg from the first of
/// across_gravity() towards the second.
inline Eigen::AngleAxisd gravity_turn(const Eigen::Vector3d& gravity, const Effect& effect) {
  const double azimuth = first_number(effect, "direction_deg") * M_PI / 180.0;
  const Eigen::Vector3d axis =
      across_gravity(gravity) * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
  return Eigen::AngleAxisd(first_number(effect, "angle_deg") * M_PI / 180.0, axis);
}

}  // namespace dynid
