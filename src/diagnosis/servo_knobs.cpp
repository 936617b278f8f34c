// SPDX-License-Identifier: Apache-2.0
#include "servo_knobs.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "dynid/effect/complete.hpp"
#include "identification/servo_data.hpp"

namespace dynid::detail {
namespace {

using P = ServoParameter;

/// Ratios that are a torque over kp, and their knobs.
constexpr std::pair<P, Knob> over_kp[] = {{P::inertia, Knob::inertia},      {P::damping, Knob::damping},
                                          {P::coulomb, Knob::coulomb},      {P::stribeck, Knob::stribeck},
                                          {P::compliance, Knob::load_gain}, {P::limit, Knob::limit},
                                          {P::spring, Knob::spring}};
constexpr std::pair<P, Knob> themselves[] = {{P::bias, Knob::bias},
                                             {P::delay, Knob::delay},
                                             {P::stribeck_velocity, Knob::stribeck_velocity},
                                             {P::load_friction, Knob::load_friction},
                                             {P::command_lag, Knob::lag},
                                             {P::backlash, Knob::backlash},
                                             {P::gravity_compensation, Knob::gravity_compensation}};

/// The gap of a joint's backlash, whose stiffness on either side is the servo's own.
void set_backlash(Robot& robot, int joint, double gap) {
  for (Effect& effect : robot.effects)
    if (effect.name == "backlash") {
      std::vector<double>& gaps = effect.parameters["gap"];
      gaps.resize(robot.joints.size(), 0.0);
      if (std::find(effect.joints.begin(), effect.joints.end(), joint + 1) != effect.joints.end()) {
        gaps[static_cast<std::size_t>(joint)] = gap;
        return;
      }
    }
  std::vector<double> gaps(robot.joints.size(), 0.0), stiffness = gaps;
  gaps[static_cast<std::size_t>(joint)] = gap;
  stiffness[static_cast<std::size_t>(joint)] =
      complete_effect({"backlash", {joint + 1}, {}}, robot).parameters.at("stiffness")[std::size_t(joint)];
  robot.effects.push_back({"backlash", {joint + 1}, {{"gap", gaps}, {"stiffness", stiffness}}});
}

}  // namespace

Knobs knobs_of(const Robot& robot, int joint) {
  const Servo& servo = *robot.joints[static_cast<std::size_t>(joint)].servo;
  const ServoJoint ratios = servo_joint(robot, joint);
  Knobs x{};
  const double kp = servo.kp > 0.0 ? servo.kp : 1.0;
  x[at(Knob::kp)] = kp;
  for (const auto& [p, k] : over_kp) x[at(k)] = ratios[p] * kp;
  for (const auto& [p, k] : themselves) x[at(k)] = ratios[p];
  return x;
}

ServoJoint servo_of(const Knobs& x) {
  ServoJoint out;
  for (const auto& [p, k] : over_kp) out[p] = x[at(k)] / x[at(Knob::kp)];
  for (const auto& [p, k] : themselves) out[p] = x[at(k)];
  return out;
}

KnobSlopes knob_slopes(const Knobs& x, const KnobState::Sensitivity& s) {
  KnobSlopes out = KnobSlopes::Zero();
  const double kp = x[at(Knob::kp)];
  for (const auto& [p, k] : over_kp) {
    const double slope = s[static_cast<int>(p)];
    out[static_cast<int>(k)] = slope / kp;
    if (slope != 0.0 && std::isfinite(x[at(k)])) out[0] -= slope * x[at(k)] / (kp * kp);
  }
  for (const auto& [p, k] : themselves) out[static_cast<int>(k)] = s[static_cast<int>(p)];
  out.tail<servo_load_parts>() = s.tail<servo_load_parts>();
  return out;
}

void turn(Robot& robot, int joint, const Knobs& nominal, const Knobs& x) {
  Joint& j = robot.joints[static_cast<std::size_t>(joint)];
  Servo& s = *j.servo;
  const bool si = s.kp > 0.0;
  const auto turned = [&](Knob k) { return x[at(k)] != nominal[at(k)]; };
  const double kp = x[at(Knob::kp)];
  if (si) {
    s.kp = kp;
    if (turned(Knob::damping)) {
      s.kd += x[at(Knob::damping)] - nominal[at(Knob::damping)];
      if (s.kd < 0.0) j.friction.linear.viscous = std::max(0.0, j.friction.linear.viscous + s.kd), s.kd = 0.0;
    }
    if (turned(Knob::coulomb)) j.friction.linear.coulomb = x[at(Knob::coulomb)];
    if (turned(Knob::inertia)) j.rotor_inertia = x[at(Knob::inertia)];
    if (turned(Knob::limit)) s.torque_limit = x[at(Knob::limit)];
    if (turned(Knob::spring)) {
      // The bias that came with it is where the spring rests.
      const double k = x[at(Knob::spring)] - nominal[at(Knob::spring)];
      Effect spring{"joint_spring", {joint + 1}, {}};
      std::vector<double> stiffness(robot.joints.size(), 0.0), rest(robot.joints.size(), 0.0);
      stiffness[static_cast<std::size_t>(joint)] = k;
      rest[static_cast<std::size_t>(joint)] = -kp * (x[at(Knob::bias)] - nominal[at(Knob::bias)]) / k;
      spring.parameters = {{"stiffness", stiffness}, {"rest", rest}};
      robot.effects.push_back(spring);
    } else {
      s.bias = x[at(Knob::bias)];
    }
  } else {
    s.natural_frequency = std::sqrt(kp / x[at(Knob::inertia)]);
    s.damping_ratio = 0.5 * x[at(Knob::damping)] / std::sqrt(kp * x[at(Knob::inertia)]);
    s.coulomb_position = x[at(Knob::coulomb)] / kp;
    s.error_limit = x[at(Knob::limit)] / kp;
    s.bias = x[at(Knob::bias)];
  }
  s.delay = x[at(Knob::delay)];
  s.stribeck_position = x[at(Knob::stribeck)] / kp;
  if (turned(Knob::stribeck_velocity)) s.stribeck_velocity = x[at(Knob::stribeck_velocity)];
  s.load_friction = x[at(Knob::load_friction)];
  s.command_time_constant = x[at(Knob::lag)];
  if (turned(Knob::backlash)) set_backlash(robot, joint, 2.0 * x[at(Knob::backlash)]);
}

KnobRange range_of(Knob k, const Knobs& nominal, const KnobScale& scale) {
  constexpr double far = 1e3;  // times a size of its own
  const double kp = nominal[at(Knob::kp)], h = scale.interval;
  switch (k) {
    case Knob::kp:
      return {true, kp / far, kp * far};
    case Knob::inertia:  // below the least a natural frequency above twice Nyquist's, which no log shows
      return {false, kp * 1e-3 * h * h, kp * 1e4 * h * h};
    case Knob::damping:
      return {false, 0.0, kp * far * h};
    case Knob::coulomb:
    case Knob::stribeck:
      return {false, 0.0, far * kp * scale.error};
    case Knob::bias:
      return {false, -far * scale.error, far * scale.error};
    case Knob::delay:
      return {false, std::min(0.0, nominal[at(k)]) - 4.0 * h, std::max(12.0 * h, 3.0 * nominal[at(k)])};
    case Knob::stribeck_velocity:
      return {true, 1e-3 * scale.speed, 10.0 * scale.speed};
    case Knob::load_friction:
      return {false, 0.0, 1.0};
    case Knob::load_gain:
      return {false, 0.0, 10.0};
    case Knob::limit:
      return {true, 1e-4 * kp * scale.error, far * kp * scale.error};
    case Knob::lag:
      return {false, 0.0, 100.0 * h};
    case Knob::spring:
      return {false, -0.9 * kp, far * kp};
    case Knob::backlash:
      return {false, 0.0, scale.error};
    case Knob::gravity_compensation:
      return {false, -0.5, 1.5};
    default:  // parts of the load
      return {false, -10.0, 10.0};
  }
}

const std::vector<ServoEffect>& servo_effects() {
  static const std::vector<ServoEffect> all = {
      {"servo_stiffness", {Knob::kp}, {}},
      {"servo_damping", {Knob::damping}, {"viscous_friction"}},
      {"command_delay", {Knob::delay}, {}},
      {"command_filter", {Knob::lag}, {}},
      {"gravity_compensation", {Knob::gravity_compensation}, {}},
      {"coulomb_friction", {Knob::coulomb}, {}},
      {"stribeck_friction", {Knob::stribeck, Knob::stribeck_velocity}, {}},
      {"load_dependent_friction", {Knob::load_friction}, {}},
      {"rotor_inertia", {Knob::inertia}, {}},
      {"encoder_offset", {Knob::bias}, {"torque_offset"}},
      {"backlash", {Knob::backlash}, {}},
      {"torque_saturation", {Knob::limit}, {}},
      {"joint_spring", {Knob::spring, Knob::bias}, {}},
  };
  return all;
}

std::vector<Knobs> starts_of(const ServoEffect& effect, const Knobs& from, const KnobScale& scale) {
  std::vector<Knobs> out;
  const double kp = from[at(Knob::kp)], h = scale.interval;
  const auto put = [&](Knob k, std::initializer_list<double> values) {
    for (const double v : values) {
      Knobs x = from;
      x[at(k)] = v;
      out.push_back(x);
    }
  };
  switch (effect.free.front()) {
    case Knob::kp:
      for (const double factor : {0.02, 0.1, 0.35, 0.75, 1.0, 1.4, 4.0}) put(Knob::kp, {kp * factor});
      break;
    case Knob::damping:
      put(Knob::damping, {from[at(Knob::damping)], kp * 0.5 * h, kp * 2.0 * h, kp * 8.0 * h});
      break;
    case Knob::coulomb:
      put(Knob::coulomb, {from[at(Knob::coulomb)], 0.05 * kp * scale.error, 0.3 * kp * scale.error});
      break;
    case Knob::delay:
      put(Knob::delay, {from[at(Knob::delay)], from[at(Knob::delay)] - h, from[at(Knob::delay)] + h,
                        from[at(Knob::delay)] + 3.0 * h, 0.5 * h});
      break;
    case Knob::lag:
      put(Knob::lag, {h, 4.0 * h});
      break;
    case Knob::gravity_compensation:
      put(Knob::gravity_compensation, {0.0, 0.5, 1.0});
      break;
    case Knob::stribeck:
      for (const double v : {0.1, 0.5}) {
        Knobs x = from;
        x[at(Knob::stribeck)] = 0.3 * from[at(Knob::coulomb)] + 0.02 * kp * scale.error;
        x[at(Knob::stribeck_velocity)] = v * scale.speed;
        out.push_back(x);
      }
      break;
    case Knob::load_friction:
      put(Knob::load_friction, {0.1, 0.3});
      break;
    case Knob::inertia:
      put(Knob::inertia,
          {from[at(Knob::inertia)], 3.0 * from[at(Knob::inertia)], 0.2 * kp * h * h, 3.0 * kp * h * h});
      break;
    case Knob::backlash:
      put(Knob::backlash, {0.02 * scale.error, 0.15 * scale.error});
      break;
    case Knob::limit:  // a little too high a limit acts where it matters; one never reached has no slope
      put(Knob::limit, {from[at(Knob::limit)]});
      for (double part = 1.0; part > 0.02; part *= 0.7) put(Knob::limit, {part * kp * scale.error});
      break;
    case Knob::spring:
      put(Knob::spring, {from[at(Knob::spring)] + 0.05 * kp, from[at(Knob::spring)] - 0.05 * kp});
      break;
    default:
      out.push_back(from);
  }
  return out;
}

bool applies(const ServoEffect& effect, const Knobs& nominal, const KnobScale& scale) {
  const bool body = nominal[at(Knob::load_gain)] > 0.0;
  switch (effect.free.front()) {
    case Knob::gravity_compensation:
      return body && scale.gravity > 0.0;
    case Knob::load_friction:
      return body && scale.load > 0.0;
    case Knob::spring:
      return body;
    case Knob::inertia:
      return true;
    default:
      return scale.moves || effect.free.front() == Knob::bias;
  }
}

bool possible(const ServoEffect& effect, const Knobs& x, const Knobs& nominal, const KnobScale& scale) {
  if (effect.free.front() != Knob::spring) return true;
  const double stiffness = x[at(Knob::spring)] - nominal[at(Knob::spring)],
               pull = x[at(Knob::kp)] * (x[at(Knob::bias)] - nominal[at(Knob::bias)]);
  const double travel = scale.highest - scale.lowest;
  // pull = - stiffness rest
  return std::abs(pull + stiffness * 0.5 * (scale.lowest + scale.highest)) <=
         1.5 * travel * std::abs(stiffness);
}

std::vector<KnobWord> words_of(const ServoEffect& effect, bool si) {
  const char* torque = si ? "N m" : "rad";
  switch (effect.free.front()) {
    case Knob::kp:
      return {{Knob::kp, si ? "kp" : "factor", si ? "N m/rad" : "1", false}};
    case Knob::damping:
      return {{Knob::damping, "coefficient", si ? "N m s/rad" : "s", true}};
    case Knob::coulomb:
      return {{Knob::coulomb, "coefficient", torque, true}};
    case Knob::inertia:
      return {{Knob::inertia, "armature", si ? "kg m^2" : "s^2", true}};
    case Knob::bias:
      return {{Knob::bias, "offset", "rad", true}};
    case Knob::delay:
      return {{Knob::delay, "delay", "s", false}};
    case Knob::lag:
      return {{Knob::lag, "time_constant", "s", false}};
    case Knob::gravity_compensation:
      return {{Knob::gravity_compensation, "part", "1", false}};
    case Knob::stribeck:
      return {{Knob::stribeck, "static", torque, true},
              {Knob::stribeck_velocity, "stribeck_velocity", "rad/s", false}};
    case Knob::load_friction:
      return {{Knob::load_friction, "coefficient", "1", true}};
    case Knob::backlash:
      return {{Knob::backlash, "gap", "rad", false}};
    case Knob::limit:
      return {{Knob::limit, "limit", torque, false}};
    case Knob::spring:
      return {{Knob::spring, "stiffness", "N m/rad", true}};
    default:
      return {};
  }
}

}  // namespace dynid::detail
