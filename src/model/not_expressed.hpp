// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "dynid/effect/enter.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail {

/// The format has words for the effect, beside those for what it enters.
inline bool says(const EffectSchema& schema, ExportFormat format) {
  return std::find(schema.formats.begin(), schema.formats.end(), format) != schema.formats.end();
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
