// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/export_format.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// What an effect belongs to, and with it what Effect::joints means.
enum class EffectScope {
  joints,  ///< any joints, each with parameters of its own
  link,    ///< one joint: the link that it carries
  pair,    ///< two joints
  arm,     ///< the whole arm
  window,  ///< a link during some time; joints: those from the base to it
};

inline const char* to_string(EffectScope scope) noexcept {
  switch (scope) {
    case EffectScope::joints:
      return "joints";
    case EffectScope::link:
      return "link";
    case EffectScope::pair:
      return "pair";
    case EffectScope::window:
      return "window";
    case EffectScope::arm:
      break;
  }
  return "arm";
}

/// The unit that a prismatic joint has where a revolute one has `unit`: N for N m, m for rad, kg for kg m^2.
/// Other units are the same for both.
inline std::string unit_of(const std::string& unit, JointType type) {
  if (type != JointType::prismatic) return unit;
  static const std::pair<const char*, const char*> linear[] = {
      {"N m", "N"},       {"rad", "m"},     {"rad/s", "m/s"}, {"N m s/rad", "N s/m"},
      {"N m/rad", "N/m"}, {"1/rad", "1/m"}, {"kg m^2", "kg"}, {"rad^2/s", "m^2/s"}};
  for (const auto& [angular, other] : linear)
    if (unit == angular) return other;
  return unit;
}

/// One parameter of an effect.
struct EffectParameter {
  std::string key;
  std::string unit;             ///< SI, of a revolute joint, `1` where there is none; see unit_of()
  std::string text;             ///< one line for a person
  bool per_joint = false;       ///< one number for each joint of the robot; else `initial.size()` numbers
  std::vector<double> initial;  ///< default of parse_effect(); one number where per_joint
  /// Values allowed, both included.
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  /// What a model file means that leaves it out; NaN where it must not.
  double absent = std::numeric_limits<double>::quiet_NaN();
  std::string form;  ///< the one of EffectSchema::forms that it belongs to; empty: every form

  bool required() const noexcept { return std::isnan(absent); }

  // For the entries of the catalogue.
  EffectParameter between(double low, double high) const {
    EffectParameter p = *this;
    p.least = low, p.most = high;
    return p;
  }
  EffectParameter at_least(double low) const { return between(low, std::numeric_limits<double>::infinity()); }
  EffectParameter or_else(double value) const {
    EffectParameter p = *this;
    p.absent = value;
    return p;
  }
  EffectParameter of(std::string form_key) const {
    EffectParameter p = *this;
    p.form = std::move(form_key);
    return p;
  }
};

struct LoopTerms;

/// One effect: what a robot does beyond rigid body and friction laws, and all that others need to know of it.
///
/// The sign throughout: measured torque = torque of the nominal model along the measured motion + the
/// effect's torque, so that friction coefficients are positive.
struct EffectSchema {
  std::string name;
  std::string text;  ///< torque added on the measured side, in a line
  EffectScope scope = EffectScope::joints;
  bool friction = false;  ///< a law of friction: a robot that has it is not one without
  std::vector<EffectParameter> parameters;
  /// An effect may be described in several ways. Each form is called by the parameter that only it has; the
  /// first is meant where none of these is given (it may be empty: it then has no parameter of its own).
  /// Where those parameters are joints' own, each joint has the form of which it has a value other than zero.
  std::vector<std::string> forms;

  /// Puts a complete effect into the robot itself; false where the robot has another such thing in the way.
  /// Null where a robot has no place for it.
  bool (*enter)(Robot&, const Effect&) = nullptr;
  /// enter() changes where the links are: right for torques, wrong for a file that others read.
  bool moves_frames = false;
  /// Adds a complete effect to what the loop computes. Null where it cannot.
  void (*compile)(LoopTerms&, const Effect&) = nullptr;
  /// Why an effect that neither enters a robot nor compiles cannot run in the loop: `it depends on ...`.
  std::string not_in_loop;
  std::vector<ExportFormat> formats;  ///< that have words for it, beside those of what it enters

  bool in_loop() const noexcept { return enter != nullptr || compile != nullptr; }
  /// Null where there is none of that key.
  const EffectParameter* find(const std::string& key) const noexcept {
    for (const EffectParameter& p : parameters)
      if (p.key == key) return &p;
    return nullptr;
  }
  /// Throws Error naming the effect, the key and those that there are.
  const EffectParameter& parameter(const std::string& key) const {
    if (const EffectParameter* p = find(key)) return *p;
    std::string known;
    for (const EffectParameter& p : parameters) known += (known.empty() ? "" : ", ") + p.key;
    throw Error("effect '" + name + "': no parameter is called '" + key + "'; its own: joints, " + known);
  }
  /// Unit of parameter `key` for joint `joint` (from 0) of the robot; of a pair, for its first joint.
  std::string unit(const std::string& key, const Robot& robot, int joint) const {
    const EffectParameter& p = parameter(key);
    const bool own = p.per_joint || scope == EffectScope::pair;
    return own ? unit_of(p.unit, robot.joints[static_cast<std::size_t>(joint)].type) : p.unit;
  }
};

}  // namespace dynid
