// SPDX-License-Identifier: Apache-2.0
#include "dynid/effect/servo_effects.hpp"

#include <algorithm>

#include "dynid/effect/complete.hpp"
#include "dynid/effect/parse.hpp"
#include "effect/parse_parameters.hpp"

namespace dynid {
namespace {

using detail::per_joint;

EffectSchema schema(const char* name, const char* text, std::vector<EffectParameter> parameters) {
  EffectSchema s;
  s.name = name;
  s.text = text;
  s.parameters = std::move(parameters);
  s.not_in_loop = "the servo, which is no part of a torque model";
  return s;
}

const EffectSchema* find_servo_effect(const std::string& name) {
  for (const EffectSchema& s : servo_effect_schemas())
    if (s.name == name) return &s;
  return nullptr;
}

Servo& servo_of(Robot& robot, const std::string& effect, int number) {
  Joint& joint = detail::joint_of(robot, number);
  if (!joint.servo)
    detail::refuse_effect(effect, "joint '" + joint.name + "' has no servo (dynid identify --servo)");
  return *joint.servo;
}

/// Every parameter given or at its default, within what the schema allows.
void complete_servo(const EffectSchema& schema, Effect& effect, int joints) {
  for (const EffectParameter& p : schema.parameters) {
    std::vector<double>& values = effect.parameters[p.key];
    if (values.empty()) {
      values.assign(static_cast<std::size_t>(joints), 0.0);
      for (const int j : effect.joints) values[static_cast<std::size_t>(j - 1)] = p.initial.front();
    }
    for (const int j : effect.joints) {
      const double x = values[static_cast<std::size_t>(j - 1)];
      if (x < p.least || x > p.most)
        detail::refuse_effect(effect.name, p.key + ": " + detail::number_text(x) + " is not allowed");
    }
  }
}

/// One stiffness, however it was given.
void unite_stiffness(Effect& effect, const Robot& robot) {
  std::vector<double>&kp = effect.parameters.at("kp"), &factor = effect.parameters.at("factor");
  bool si = true;
  for (const int number : effect.joints) {
    const auto j = static_cast<std::size_t>(number - 1);
    const double nominal = robot.joints[j].servo->kp;
    if (kp[j] > 0.0 && !(nominal > 0.0))
      detail::refuse_effect(effect.name, "kp: the model knows ratios only: give a factor");
    si = si && nominal > 0.0;
    if (kp[j] > 0.0)
      factor[j] = kp[j] / nominal;
    else
      kp[j] = factor[j] * nominal;
    if (!(factor[j] > 0.0)) detail::refuse_effect(effect.name, "a stiffness must be positive");
  }
  effect.parameters.erase(si ? "factor" : "kp");
}

}  // namespace

const std::vector<EffectSchema>& servo_effect_schemas() {
  static const std::vector<EffectSchema> all = {
      schema("servo_stiffness", "kp (u - q): another kp than the model's",
             {per_joint("kp", "N m/rad", "0: `factor` says it", 0.0).at_least(0.0),
              per_joint("factor", "1", "times the model's", 0.7).at_least(0.0)}),
      schema("servo_damping", "-kd dq: more or less of it than the model's",
             {per_joint("coefficient", "N m s/rad", "change of kd", 1.0)}),
      schema("command_delay", "u(t - d)",
             {per_joint("delay", "s", "d, from a command's stamp to its effect", 0.03).between(0.0, 1.0)}),
      schema("command_filter", "u behind a first-order filter",
             {per_joint("time_constant", "s", "of the filter", 0.04).between(0.0, 10.0)}),
      schema("gravity_compensation", "the servo adds a part of the gravity torque",
             {per_joint("part", "1", "1: all of it", 1.0)}),
  };
  return all;
}

Effect parse_servo_effect(const std::string& text, const Robot& robot) {
  const EffectSchema* const own = find_servo_effect(text.substr(0, text.find(':')));
  if (own == nullptr) return parse_effect(text, robot);
  Effect effect = detail::parse_parameters(*own, text, robot);
  Robot checked = robot;
  for (const int j : effect.joints) servo_of(checked, effect.name, j);
  complete_servo(*own, effect, robot.size());
  if (effect.name == "servo_stiffness") unite_stiffness(effect, robot);
  return effect;
}

bool enter_servo(Robot& robot, const Effect& effect) {
  const std::string& name = effect.name;
  const auto value = [&](const char* key, int number) { return joint_number(effect, key, number - 1); };
  const auto for_servos = [&](const auto& set) {
    for (const int number : effect.joints) set(servo_of(robot, name, number), number);
    return true;
  };
  if (name == "servo_stiffness")
    return for_servos([&](Servo& s, int j) {
      if (s.kp > 0.0) {
        s.kp = effect.parameters.count("kp") > 0 ? value("kp", j) : s.kp * value("factor", j);
        return;
      }
      const double root = std::sqrt(value("factor", j));  // J and kd + fv stay, what is over kp does not
      s.natural_frequency *= root;
      s.damping_ratio /= root;
      s.coulomb_position /= root * root;
      s.stribeck_position /= root * root;
      s.error_limit /= root * root;
    });
  if (name == "servo_damping")
    return for_servos([&](Servo& s, int j) {
      if (s.kp > 0.0)
        s.kd += value("coefficient", j);
      else
        s.damping_ratio += 0.5 * s.natural_frequency * value("coefficient", j);
    });
  if (name == "command_delay") return for_servos([&](Servo& s, int j) { s.delay = value("delay", j); });
  if (name == "command_filter")
    return for_servos([&](Servo& s, int j) { s.command_time_constant = value("time_constant", j); });
  if (name == "encoder_offset") return for_servos([&](Servo& s, int j) { s.bias += value("offset", j); });
  if (name == "torque_saturation")
    return for_servos([&](Servo& s, int j) {
      const double limit = std::max(value("limit", j), value("command_limit", j));
      if (!(limit > 0.0)) return;
      (s.kp > 0.0 ? s.torque_limit : s.error_limit) = limit;
    });
  return false;
}

}  // namespace dynid
