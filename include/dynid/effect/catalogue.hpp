// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "dynid/effect/derived.hpp"
#include "dynid/effect/loop_terms.hpp"
#include "dynid/effect/schema.hpp"

namespace dynid {
namespace detail {

inline EffectParameter per_joint(std::string key, std::string unit, std::string text, double initial) {
  EffectParameter p;
  p.key = std::move(key), p.unit = std::move(unit), p.text = std::move(text);
  p.per_joint = true;
  p.initial = {initial};
  return p;
}
inline EffectParameter of_all(std::string key, std::string unit, std::string text,
                              std::vector<double> initial) {
  EffectParameter p = per_joint(std::move(key), std::move(unit), std::move(text), 0.0);
  p.per_joint = false;
  p.initial = std::move(initial);
  return p;
}

constexpr double least_divisor = 1e-9;  // least of what is divided by

/// The smoothing of sign(dq) that every dry friction has.
inline EffectParameter sign_scale() {
  return per_joint("velocity_scale", "rad/s", "v_s: sign(dq) is tanh(dq / v_s)", 0.005)
      .at_least(least_divisor);
}

inline Joint& joint_of(Robot& robot, int number) {
  return robot.joints[static_cast<std::size_t>(number - 1)];
}

/// Adds value `key` of each of the effect's joints by `add(joint, value)`; always true.
template <class Add>
bool enter_joints(Robot& robot, const Effect& effect, const char* key, const Add& add) {
  for (const int j : effect.joints) add(joint_of(robot, j), joint_number(effect, key, j - 1));
  return true;
}

inline void compile_dry(LoopTerms& terms, const Effect& effect, const char* forward, const char* back) {
  for (const int number : effect.joints) {
    const int j = number - 1;
    DryFrictionTerm term;
    term.joint = j;
    term.forward = joint_number(effect, forward, j), term.back = joint_number(effect, back, j);
    term.scale = joint_number(effect, "velocity_scale", j);
    if (const double v = joint_number(effect, "stribeck_velocity", j); v > 0.0) term.slowness = 1.0 / v;
    term.exponent = joint_number(effect, "exponent", j, 2.0);
    if (term.forward != 0.0 || term.back != 0.0) terms.dry.push_back(term);
  }
}

// ------------------------------------------------------------------------------------------- the rigid body

inline EffectSchema payload() {
  EffectSchema s;
  s.name = "payload";
  s.text = "a body fixed to the tip, a solid ball or any other: Y_tip(q, dq, ddq) pi";
  s.scope = EffectScope::arm;
  s.forms = {"radius", "inertia"};
  s.parameters = {
      of_all("mass", "kg", "", {1.0}).at_least(0.0),
      of_all("com", "m", "of a ball: its centre in the frame of the tip; else: in that of the last link",
             {0.0, 0.0, 0.1}),
      of_all("radius", "m", "of the ball", {0.04}).at_least(0.0).of("radius"),
      of_all("inertia", "kg m^2", "xx, xy, xz, yy, yz, zz about com, in the axes of the last link",
             {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})
          .of("inertia")};
  s.enter = [](Robot& robot, const Effect& effect) {
    robot.joints.back().parameters += payload_body(robot, effect);
    return true;
  };
  return s;
}

inline EffectSchema link_inertial_error() {
  EffectSchema s;
  s.name = "link_inertial_error";
  s.text = "one link is another body than the model says";
  s.scope = EffectScope::link;
  s.forms = {"com", "first_moment"};
  s.parameters = {
      of_all("link", "1", "the link, from 1 (0: that of joints)", {0.0}).at_least(0.0).or_else(0.0),
      of_all("mass", "kg", "change of the mass", {0.5}),
      of_all("com", "m", "change of the centre of mass, in the link frame", {0.0, 0.0, 0.0}).of("com"),
      of_all("inertia", "1", "relative change of the inertia about it", {0.0}).at_least(-0.9).of("com"),
      of_all("first_moment", "kg m", "change of mass times centre of mass", {0.0, 0.0, 0.0})
          .of("first_moment"),
      of_all("inertia_about_origin", "kg m^2", "change of xx, xy, yy, xz, yz, zz about the link's origin",
             {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})
          .of("first_moment")};
  s.enter = [](Robot& robot, const Effect& effect) {
    StandardParameters& link = joint_of(robot, effect.joints.front()).parameters;
    link += link_change(link, effect);
    return true;
  };
  return s;
}

inline EffectSchema gravity_tilt() {
  EffectSchema s;
  s.name = "gravity_tilt";
  s.text = "the base is not level: gravity is turned about a horizontal axis";
  s.scope = EffectScope::arm;
  s.parameters = {
      of_all("angle_deg", "deg", "", {2.0}).between(-180.0, 180.0),
      of_all("direction_deg", "deg", "azimuth of the axis in the x-y plane of the base frame", {0.0})
          .between(-360.0, 360.0)};
  s.enter = [](Robot& robot, const Effect& effect) {
    robot.gravity = gravity_turn(robot.gravity, effect) * robot.gravity;
    return true;
  };
  return s;
}

inline EffectSchema rotor_inertia() {
  EffectSchema s;
  s.name = "rotor_inertia";
  s.text = "Ia ddq";
  s.parameters = {per_joint("armature", "kg m^2", "Ia, reflected to the joint", 0.2)};
  s.enter = [](Robot& robot, const Effect& effect) {
    return enter_joints(robot, effect, "armature", [](Joint& j, double x) { j.rotor_inertia += x; });
  };
  return s;
}

// ------------------------------------------------------------------------------------------------- friction

inline EffectSchema viscous_friction() {
  EffectSchema s;
  s.name = "viscous_friction";
  s.friction = true;
  s.text = "Fv dq";
  s.parameters = {per_joint("coefficient", "N m s/rad", "Fv", 1.0)};
  s.enter = [](Robot& robot, const Effect& effect) {
    return enter_joints(robot, effect, "coefficient",
                        [](Joint& j, double x) { j.friction.linear.viscous += x; });
  };
  return s;
}

inline EffectSchema coulomb_friction() {
  EffectSchema s;
  s.name = "coulomb_friction";
  s.friction = true;
  s.text = "Fc sign(dq)";
  s.parameters = {per_joint("coefficient", "N m", "Fc", 1.0), sign_scale()};
  s.enter = [](Robot& robot, const Effect& effect) {
    // A joint has one smoothed sign: where it already has a Coulomb term of another width, the effect stays
    // one of its own.
    for (const int j : effect.joints) {
      const LinearFriction& f = joint_of(robot, j).friction.linear;
      if (f.coulomb != 0.0 && f.velocity_scale != joint_number(effect, "velocity_scale", j - 1)) return false;
    }
    for (const int j : effect.joints) {
      LinearFriction& f = joint_of(robot, j).friction.linear;
      f.coulomb += joint_number(effect, "coefficient", j - 1);
      f.velocity_scale = joint_number(effect, "velocity_scale", j - 1);
    }
    return true;
  };
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    compile_dry(terms, effect, "coefficient", "coefficient");
  };
  return s;
}

inline EffectSchema asymmetric_coulomb_friction() {
  EffectSchema s;
  s.name = "asymmetric_coulomb_friction";
  s.friction = true;
  s.text = "Fc+ sign(dq) forwards, Fc- sign(dq) backwards";
  s.parameters = {per_joint("coefficient_positive", "N m", "Fc+, for dq > 0", 1.2),
                  per_joint("coefficient_negative", "N m", "Fc-, for dq < 0", 0.5), sign_scale()};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    compile_dry(terms, effect, "coefficient_positive", "coefficient_negative");
  };
  return s;
}

inline EffectSchema stribeck_friction() {
  EffectSchema s;
  s.name = "stribeck_friction";
  s.friction = true;
  s.text = "Fs exp(-|dq / v|^delta) sign(dq): what breaking away takes beyond Coulomb friction";
  s.parameters = {per_joint("static", "N m", "Fs", 1.0),
                  per_joint("stribeck_velocity", "rad/s", "v", 0.2).at_least(least_divisor),
                  per_joint("exponent", "1", "delta", 2.0).between(0.5, 4.0).or_else(2.0), sign_scale()};
  s.compile = [](LoopTerms& terms, const Effect& effect) { compile_dry(terms, effect, "static", "static"); };
  return s;
}

inline EffectSchema load_dependent_friction() {
  EffectSchema s;
  s.name = "load_dependent_friction";
  s.friction = true;
  s.text = "Fl |tau| sign(dq), tau the torque passed through the joint";
  s.parameters = {per_joint("coefficient", "1", "Fl", 0.08).between(-0.9, 0.9), sign_scale()};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    for (const int j : effect.joints) {
      const double coefficient = joint_number(effect, "coefficient", j - 1);
      if (coefficient != 0.0)
        terms.load.push_back({j - 1, coefficient, joint_number(effect, "velocity_scale", j - 1)});
    }
  };
  return s;
}

inline EffectSchema presliding_hysteresis() {
  EffectSchema s;
  s.name = "presliding_hysteresis";
  s.friction = true;
  s.text = "LuGre friction: sigma0 z + sigma1 dz/dt, dz/dt = dq - sigma0 |dq| z / Fc";
  s.forms = {"stiffness", "slip"};
  s.parameters = {
      per_joint("coulomb", "N m", "Fc, reached when it slips", 1.5),
      per_joint("stiffness", "N m/rad", "sigma0, of the bristle", 50.0)
          .at_least(least_divisor)
          .of("stiffness"),
      per_joint("damping", "N m s/rad", "sigma1, of the bristle", 0.3)
          .at_least(0.0)
          .or_else(0.0)
          .of("stiffness"),
      per_joint("slip", "rad", "Fc / sigma0: such a joint has this instead of stiffness and damping", 0.0)
          .at_least(0.0)
          .of("slip")};
  s.not_in_loop = "the way that the joint has come, a hidden state";
  return s;
}

inline EffectSchema thermal_friction_drift() {
  EffectSchema s;
  s.name = "thermal_friction_drift";
  s.friction = true;
  s.text = "Fv (1 - w) dq, T dw/dt = (dq / v)^2 - w: a cold joint that warms by moving";
  s.forms = {"time_constant", "motion_constant"};
  s.parameters = {
      per_joint("coefficient", "N m s/rad", "Fv, when cold", 2.0),
      per_joint("time_constant", "s", "T", 8.0).at_least(least_divisor).of("time_constant"),
      per_joint("reference_speed", "rad/s",
                "v: speed that keeps it warm; 0: it warms by the clock, exp(-t / T)", 0.5)
          .at_least(0.0)
          .or_else(0.0)
          .of("time_constant"),
      per_joint("motion_constant", "rad^2/s",
                "H0, in exp(-H / H0), H the integral of dq^2: such a joint has this instead of T and v", 0.0)
          .at_least(0.0)
          .of("motion_constant")};
  s.not_in_loop = "how warm the joint is, a hidden state";
  return s;
}

// ------------------------------------------------------------------------------------------------- position

inline EffectSchema joint_spring() {
  EffectSchema s;
  s.name = "joint_spring";
  s.text = "k (q - q0): cable, counterbalance";
  s.parameters = {per_joint("stiffness", "N m/rad", "k", 2.0),
                  per_joint("rest", "rad", "q0", 0.0).or_else(0.0)};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    // Two springs on a joint are one: k (q - q0), k the sum, k q0 the sum of k q0.
    for (const int j : effect.joints) {
      const double k = joint_number(effect, "stiffness", j - 1);
      terms.stiffness[j - 1] += k;
      terms.offset[j - 1] -= k * joint_number(effect, "rest", j - 1);
    }
  };
  s.formats = {ExportFormat::mjcf};
  return s;
}

inline EffectSchema torque_ripple() {
  EffectSchema s;
  s.name = "torque_ripple";
  s.text = "A sin(N q + phase)";
  s.parameters = {per_joint("amplitude", "N m", "A", 0.5),
                  per_joint("order", "1/rad", "N, periods a turn", 12.0).at_least(0.0),
                  per_joint("phase", "rad", "", 0.0).or_else(0.0)};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    for (const int j : effect.joints)
      terms.ripple.push_back({j - 1, joint_number(effect, "amplitude", j - 1),
                              joint_number(effect, "order", j - 1), joint_number(effect, "phase", j - 1)});
  };
  return s;
}

// ---------------------------------------------------------------------------------------------- the sensors

inline EffectSchema torque_offset() {
  EffectSchema s;
  s.name = "torque_offset";
  s.text = "b";
  s.parameters = {per_joint("offset", "N m", "b", 1.0)};
  s.enter = [](Robot& robot, const Effect& effect) {
    return enter_joints(robot, effect, "offset", [](Joint& j, double x) { j.friction.linear.offset += x; });
  };
  return s;
}

inline EffectSchema torque_gain() {
  EffectSchema s;
  s.name = "torque_gain";
  s.text = "G tau: the sensor reads (1 + G) tau";
  s.parameters = {per_joint("gain", "1", "G", 0.1)};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    for (const int j : effect.joints) terms.gain[j - 1] += joint_number(effect, "gain", j - 1);
  };
  return s;
}

inline EffectSchema time_delay() {
  EffectSchema s;
  s.name = "time_delay";
  s.text = "tau(t - d) - tau(t): the measured torque is late";
  s.scope = EffectScope::arm;
  s.forms = {"delay_s", "channel_delay_s"};
  s.parameters = {of_all("delay_s", "s", "d", {0.01}).between(-0.5, 0.5).of("delay_s"),
                  per_joint("channel_delay_s", "s", "such a joint has this instead", 0.0)
                      .between(-0.5, 0.5)
                      .of("channel_delay_s")};
  s.not_in_loop = "the torque of another instant";
  return s;
}

inline EffectSchema encoder_offset() {
  EffectSchema s;
  s.name = "encoder_offset";
  s.text = "(d tau / d q) dq0: the true position is the measured one + dq0";
  s.parameters = {per_joint("offset", "rad", "dq0", 0.03)};
  s.enter = [](Robot& robot, const Effect& effect) {
    return enter_joints(robot, effect, "offset", [](Joint& j, double x) {
      if (j.type == JointType::prismatic)
        j.origin = j.origin * Eigen::Translation3d(x * j.axis);
      else
        j.origin = j.origin * Eigen::AngleAxisd(x, j.axis);
      j.dh.reset();
    });
  };
  s.moves_frames = true;
  return s;
}

inline EffectSchema torque_saturation() {
  EffectSchema s;
  s.name = "torque_saturation";
  s.text = "the measured torque stops at +-limit";
  s.forms = {"limit", "command_limit"};
  s.parameters = {per_joint("limit", "N m", "0: none on this joint", 20.0).at_least(0.0).of("limit"),
                  per_joint("command_limit", "N m",
                            "of the drive, whose command is measured: such a joint has this instead", 0.0)
                      .at_least(0.0)
                      .of("command_limit")};
  s.not_in_loop = "a torque that the limit keeps from being measured";
  return s;
}

// ------------------------------------------------------------------------------------------ the transmission

inline EffectParameter spring_stiffness(double initial) {
  return per_joint("stiffness", "N m/rad", "of the spring", initial);
}
inline EffectParameter motor_inertia() {
  return per_joint("motor_inertia", "kg m^2", "of the motor, at the joint", 0.3)
      .at_least(least_divisor)
      .or_else(0.3);
}
inline EffectParameter spring_damping_ratio() {
  return of_all("damping_ratio", "1", "of the motor on the spring", {0.1}).between(0.0, 1.0).or_else(0.1);
}

inline EffectSchema joint_elasticity() {
  EffectSchema s;
  s.name = "joint_elasticity";
  s.text = "a motor mass behind a spring K: tau = K (theta - q), theta the position measured";
  s.forms = {"", "damping"};
  s.parameters = {
      spring_stiffness(5000.0), motor_inertia(), spring_damping_ratio(),
      per_joint("damping", "1",
                "damping ratio of the link on the spring, its motor held; a plant has damping_ratio", 0.0)
          .at_least(0.0)
          .or_else(0.0)
          .of("damping")};
  s.not_in_loop = "where the link is behind its spring, a hidden state";
  return s;
}

inline EffectSchema backlash() {
  EffectSchema s;
  s.name = "backlash";
  s.text = "the same with a stiff spring that has play: no torque inside the gap";
  s.forms = {"gap", "dead_zone"};
  s.parameters = {
      per_joint("gap", "rad", "of the dead zone, from end to end", 0.01).at_least(0.0).of("gap"),
      spring_stiffness(20000.0).of("gap"),
      motor_inertia().of("gap"),
      spring_damping_ratio().of("gap"),
      per_joint("dead_zone", "N m",
                "torque that is lost on the way: such a joint has this instead of gap and spring", 0.0)

          .of("dead_zone"),
      per_joint("contact_torque", "N m", "over which the loss comes as the torque changes sign", 0.1)
          .at_least(least_divisor)
          .or_else(0.1)
          .of("dead_zone")};
  s.not_in_loop = "the flank that carries, a hidden state";
  return s;
}

// ------------------------------------------------------------------------------------------- pairs, contacts

inline EffectSchema gear_coupling() {
  EffectSchema s;
  s.name = "gear_coupling";
  s.text = "friction and inertia on w = dq_a + r dq_b, passed on to a and, times r, to b";
  s.scope = EffectScope::pair;
  s.parameters = {
      of_all("viscous", "N m s/rad", "on w", {0.5}), of_all("coulomb", "N m", "on w", {0.5}),
      of_all("inertia", "kg m^2", "on dw/dt", {0.05}), of_all("ratio", "1", "r", {1.0}),
      of_all("velocity_scale", "rad/s", "v_s: sign(w) is tanh(w / v_s)", {0.005}).at_least(least_divisor)};
  s.compile = [](LoopTerms& terms, const Effect& effect) {
    terms.shafts.push_back({effect.joints[0] - 1, effect.joints[1] - 1, first_number(effect, "ratio"),
                            first_number(effect, "viscous"), first_number(effect, "coulomb"),
                            first_number(effect, "inertia"), first_number(effect, "velocity_scale")});
  };
  return s;
}

inline EffectSchema external_contact() {
  EffectSchema s;
  s.name = "external_contact";
  s.text = "-J^T F, F the force of the surroundings on the robot, from start for duration";
  s.scope = EffectScope::window;
  s.parameters = {
      of_all("link", "1", "link touched, from 1 (0: the last)", {0.0}).at_least(0.0).or_else(0.0),
      of_all("point", "m", "where, in the link frame", {0.0, 0.0, 0.0}),
      of_all("force", "N", "F, in the axes of the base frame", {15.0, 0.0, -15.0}),
      of_all("start", "s", "", {5.0}),
      of_all("duration", "s", "", {1.5}).at_least(0.0),
      of_all("rise_time", "s", "in which the force comes, and goes", {0.02}).at_least(least_divisor)};
  s.not_in_loop = "a time of one log: what surroundings do is for the residual to find";
  return s;
}

}  // namespace detail

/// The catalogue: every effect that there is a word for.
inline const std::vector<EffectSchema>& effect_schemas() {
  static const std::vector<EffectSchema> all = {detail::payload(),
                                                detail::link_inertial_error(),
                                                detail::gravity_tilt(),
                                                detail::rotor_inertia(),
                                                detail::viscous_friction(),
                                                detail::coulomb_friction(),
                                                detail::asymmetric_coulomb_friction(),
                                                detail::stribeck_friction(),
                                                detail::load_dependent_friction(),
                                                detail::presliding_hysteresis(),
                                                detail::thermal_friction_drift(),
                                                detail::joint_spring(),
                                                detail::torque_ripple(),
                                                detail::torque_offset(),
                                                detail::torque_gain(),
                                                detail::time_delay(),
                                                detail::encoder_offset(),
                                                detail::torque_saturation(),
                                                detail::joint_elasticity(),
                                                detail::backlash(),
                                                detail::gear_coupling(),
                                                detail::external_contact()};
  return all;
}

/// The entry of that name, or null.
inline const EffectSchema* find_effect_schema(const std::string& name) {
  for (const EffectSchema& schema : effect_schemas())
    if (schema.name == name) return &schema;
  return nullptr;
}

/// The entry of that name. Throws Error `effect 'x': unknown; known: ...`.
inline const EffectSchema& effect_schema(const std::string& name) {
  if (const EffectSchema* schema = find_effect_schema(name)) return *schema;
  std::string known;
  for (const EffectSchema& schema : effect_schemas()) known += (known.empty() ? "" : ", ") + schema.name;
  throw Error("effect '" + name + "': unknown; known: " + known);
}

}  // namespace dynid
