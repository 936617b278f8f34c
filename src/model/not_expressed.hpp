// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail {

/// The format has words for the effect, beside those for what it enters.
inline bool says(const EffectSchema& schema, ExportFormat format) {
  return std::find(schema.formats.begin(), schema.formats.end(), format) != schema.formats.end();
}

/// A line for what a joint's friction has beyond damping and dry friction, for which every format has words.
inline void list_friction_not_expressed(const JointFriction& friction, const std::string& prefix,
                                        std::vector<std::string>& list) {
  const LinearFriction& linear = friction.linear;
  if (linear.velocity_scale != 0.0 && linear.coulomb != 0.0)
    list.push_back(prefix + "smoothing of Coulomb friction below " + exact_number(linear.velocity_scale) +
                   " rad/s");
  if (linear.offset != 0.0)
    list.push_back(prefix + "friction offset " + exact_number(linear.offset) + " N m");
  const auto list_law = [&](const auto& law) {
    if (std::is_same_v<std::decay_t<decltype(law)>, LinearFriction> || !acts(law)) return;
    std::vector<std::string> values;
    for (const auto& p : law.parameters())
      values.push_back(std::string(p.key) + " " + exact_number(law.*p.value));
    list.push_back(prefix + law.name + " friction " + join(values));
  };
  std::apply([&](const auto&... law) { (list_law(law), ...); }, friction.laws());
}

/// A line for each effect of the robot but those that the format has words for.
inline void list_effects_not_expressed(const Robot& robot, ExportFormat format,
                                       std::vector<std::string>& list) {
  for (const Effect& effect : robot.effects) {
    const EffectSchema* const schema = find_effect_schema(effect.name);
    if (schema != nullptr && says(*schema, format)) continue;
    std::string line = "effect '" + effect.name + "'";
    for (const int joint : effect.joints)
      line += (joint == effect.joints.front() ? " of joint " : ", ") + std::to_string(joint);
    list.push_back(line);
  }
}

}  // namespace dynid::detail
