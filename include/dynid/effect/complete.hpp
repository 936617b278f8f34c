// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

#include "dynid/effect/catalogue.hpp"
#include "dynid/effect/schema.hpp"

namespace dynid {
namespace detail {

[[noreturn]] inline void refuse_effect(const std::string& name, const std::string& what) {
  throw Error("effect '" + name + "': " + what);
}

inline std::string number_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

/// The joints meant, checked: increasing, each once, of the robot, as many as the scope asks for.
inline std::vector<int> effect_joints(const EffectSchema& schema, std::vector<int> joints,
                                      const Robot& robot) {
  const int n = robot.size();
  std::sort(joints.begin(), joints.end());
  for (std::size_t k = 0; k < joints.size(); ++k) {
    if (joints[k] < 1 || joints[k] > n)
      refuse_effect(schema.name, "joints: the robot has no joint " + std::to_string(joints[k]) +
                                     " (it has 1 to " + std::to_string(n) + ")");
    if (k > 0 && joints[k] == joints[k - 1])
      refuse_effect(schema.name, "joints: " + std::to_string(joints[k]) + " stands there twice");
  }
  if (schema.scope == EffectScope::link) {
    if (joints.empty()) joints = {n};
    if (joints.size() != 1)
      refuse_effect(schema.name, "joints: one joint is meant, the one that carries the link");
  } else if (schema.scope == EffectScope::pair) {
    if (joints.empty() && n >= 2) joints = {n - 1, n};
    if (joints.size() != 2) refuse_effect(schema.name, "joints: two joints are meant");
  } else if (joints.empty()) {
    joints.resize(static_cast<std::size_t>(n));
    std::iota(joints.begin(), joints.end(), 1);
  }
  return joints;
}

/// Whether the effect's forms are each joint's own.
inline bool forms_by_joint(const EffectSchema& schema) {
  return schema.forms.size() > 1 && schema.parameter(schema.forms[1]).per_joint;
}

inline bool any_of_value(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double x) { return x != 0.0; });
}

/// The form of joint `joint` (from 0; of the whole effect where forms are not the joints' own).
inline std::string form_at(const EffectSchema& schema, const Effect& effect, int joint) {
  if (schema.forms.empty()) return "";
  const bool first_given = schema.forms[0].empty() || effect.parameters.count(schema.forms[0]) > 0;
  if (!forms_by_joint(schema)) {
    for (const std::string& form : schema.forms)
      if (effect.parameters.count(form) > 0) return form;
    return schema.forms[0];
  }
  for (std::size_t k = 1; k < schema.forms.size(); ++k) {
    if (joint_number(effect, schema.forms[k].c_str(), joint) != 0.0) return schema.forms[k];
    if (!first_given && effect.parameters.count(schema.forms[k]) > 0) return schema.forms[k];
  }
  return schema.forms[0];
}

enum class Missing { initial, absent };

inline Effect complete(const Effect& given, const Robot& robot, Missing missing) {
  const EffectSchema& schema = effect_schema(given.name);
  const int n = robot.size();
  for (const auto& entry : given.parameters) schema.parameter(entry.first);
  Effect full = {given.name, given.joints, {}};
  const auto link = given.parameters.find("link");
  const bool names_link = link != given.parameters.end() && !link->second.empty() && link->second[0] != 0.0;
  if (names_link && (link->second[0] != std::floor(link->second[0]) || link->second[0] < 1.0 ||
                     link->second[0] > double(n)))
    refuse_effect(schema.name, "link: " + number_text(link->second[0]) +
                                   " is not a link of the robot (1 to " + std::to_string(n) + ")");
  if (missing == Missing::absent && given.joints.empty() &&
      (schema.scope == EffectScope::joints || schema.scope == EffectScope::pair ||
       (schema.scope == EffectScope::link && !names_link)))
    refuse_effect(schema.name, "joints are missing");
  if (schema.scope == EffectScope::link && names_link) {
    const int number = static_cast<int>(link->second[0]);
    if (full.joints.empty()) full.joints = {number};
    if (full.joints != std::vector<int>{number})
      refuse_effect(schema.name, "link: " + std::to_string(number) + " is not that of joints");
  }
  full.joints = effect_joints(schema, full.joints, robot);
  if (schema.scope == EffectScope::window) {  // joints beyond the link do not feel it
    const int last = names_link ? static_cast<int>(link->second[0]) : full.joints.back();
    full.joints.resize(static_cast<std::size_t>(last));
    std::iota(full.joints.begin(), full.joints.end(), 1);
  }

  // What is given, in its size.
  Effect expanded = full;
  for (const auto& [key, values] : given.parameters) {
    const EffectParameter& p = schema.parameter(key);
    std::vector<double>& own = expanded.parameters[key];
    const std::size_t size = p.per_joint ? static_cast<std::size_t>(n) : p.initial.size();
    if (values.size() != size && !(p.per_joint && values.size() == 1))
      refuse_effect(schema.name, key + ": expected " + std::to_string(size) + " value" +
                                     (size == 1 ? "" : "s") + ", found " + std::to_string(values.size()));
    if (p.per_joint) {
      own.assign(size, 0.0);
      for (const int j : full.joints)
        own[static_cast<std::size_t>(j - 1)] =
            values.size() == size ? values[static_cast<std::size_t>(j - 1)] : values[0];
    } else {
      own = values;
    }
    for (const double x : values)
      if (!std::isfinite(x)) refuse_effect(schema.name, key + ": " + number_text(x) + " is not finite");
  }
  if (!forms_by_joint(schema)) {
    std::string first;
    for (const std::string& form : schema.forms) {
      if (form.empty() || expanded.parameters.count(form) == 0) continue;
      if (!first.empty())
        refuse_effect(schema.name, "'" + first + "' and '" + form + "' are two ways to say the same");
      first = form;
    }
  }

  for (const EffectParameter& p : schema.parameters) {
    std::vector<bool> used(static_cast<std::size_t>(n), false);
    bool any = false;
    for (const int j : full.joints) {
      const bool here = p.form.empty() || form_at(schema, expanded, j - 1) == p.form;
      used[static_cast<std::size_t>(j - 1)] = here;
      any = any || here;
    }
    const auto given_value = expanded.parameters.find(p.key);
    if (given_value == expanded.parameters.end() && any && missing == Missing::absent && p.required())
      refuse_effect(schema.name, "parameter '" + p.key + "' is missing");
    const double fill = missing == Missing::absent ? p.absent : p.initial.front();
    std::vector<double>& values = full.parameters[p.key];
    if (given_value != expanded.parameters.end()) {
      values = given_value->second;
    } else if (p.per_joint) {
      values.assign(static_cast<std::size_t>(n), 0.0);
      for (std::size_t j = 0; j < used.size(); ++j)
        if (used[j]) values[j] = fill;
    } else if (any || forms_by_joint(schema)) {
      values = p.initial;
      if (missing == Missing::absent) std::fill(values.begin(), values.end(), any ? p.absent : 0.0);
    } else {
      full.parameters.erase(p.key);  // of another form
      continue;
    }
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (p.per_joint ? !used[k] : !any) continue;
      if (!(values[k] >= p.least && values[k] <= p.most))
        refuse_effect(schema.name, p.key + ": " + number_text(values[k]) + " is not between " +
                                       number_text(p.least) + " and " + number_text(p.most) +
                                       (p.unit == "1" ? "" : " " + p.unit) +
                                       (p.per_joint ? " (joint " + std::to_string(k + 1) + ")" : ""));
    }
  }
  if (const auto which = full.parameters.find("link"); which != full.parameters.end())
    which->second = {double(full.joints.back())};
  return full;
}

}  // namespace detail

/// The effect with every parameter in place: the schema's defaults where left out, zero for joints that it
/// does not have or that have another form; one number for a joint's own parameter is for all its joints;
/// joints are filled in where the whole arm is meant. For what people say of a robot to simulate.
/// Throws Error naming the effect, the key, the joint and what is wrong: unknown name or key, wrong number of
/// values, a value out of range or not finite, a joint that the robot does not have or that is named twice.
inline Effect complete_effect(const Effect& effect, const Robot& robot) {
  return detail::complete(effect, robot, detail::Missing::initial);
}

/// The same for what a model file says: what is left out means what EffectParameter::absent says, and no
/// default stands in for a parameter that is required. Throws Error as complete_effect() does, and
/// `effect 'x': parameter 'k' is missing`.
inline Effect checked_effect(const Effect& effect, const Robot& robot) {
  return detail::complete(effect, robot, detail::Missing::absent);
}

/// Key of the form that a complete effect has at joint `joint` (from 0): empty where it has one only.
inline std::string effect_form(const Effect& effect, int joint) {
  return detail::form_at(effect_schema(effect.name), effect, joint);
}

/// A complete effect whose joints have several forms as one effect for each form, in the order of the schema,
/// each with the parameters of its form alone. What is said of the whole arm for some joints only is said of
/// each of them.
inline std::vector<Effect> split_forms(const Effect& given, const Robot& robot) {
  const EffectSchema& schema = effect_schema(given.name);
  if (!detail::forms_by_joint(schema)) return {given};
  Effect effect = given;
  const EffectParameter& first = schema.parameters.front();
  if (!first.per_joint && schema.scope == EffectScope::arm) {
    std::vector<double>& own = effect.parameters[schema.forms[1]];
    own.resize(robot.joints.size(), 0.0);
    const bool some = static_cast<int>(effect.joints.size()) < robot.size() || detail::any_of_value(own);
    for (const int j : effect.joints) {
      double& value = own[static_cast<std::size_t>(j - 1)];
      if (some && value == 0.0) value = effect.parameters.at(first.key).front();
    }
  }
  std::vector<Effect> parts;
  for (const std::string& form : schema.forms) {
    Effect part = {effect.name, {}, {}};
    for (const int j : effect.joints)
      if (detail::form_at(schema, effect, j - 1) == form) part.joints.push_back(j);
    if (part.joints.empty()) continue;
    for (const auto& [key, values] : effect.parameters) {
      const EffectParameter& p = schema.parameter(key);
      if (!p.form.empty() && p.form != form) continue;
      std::vector<double>& own = part.parameters[key] = values;
      for (std::size_t k = 0; p.per_joint && k < own.size(); ++k)
        if (!std::binary_search(part.joints.begin(), part.joints.end(), static_cast<int>(k) + 1))
          own[k] = 0.0;
    }
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace dynid
