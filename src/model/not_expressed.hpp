// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid::detail {

/// A line for each effect of the robot but those that the format has words for.
inline void list_effects_not_expressed(const Robot& robot, std::initializer_list<const char*> expressed,
                                       std::vector<std::string>& list) {
  for (const Effect& effect : robot.effects) {
    if (std::any_of(expressed.begin(), expressed.end(),
                    [&](const char* name) { return effect.name == name; }))
      continue;
    std::string line = "effect '" + effect.name + "'";
    for (const int joint : effect.joints)
      line += (joint == effect.joints.front() ? " of joint " : ", ") + std::to_string(joint);
    list.push_back(line);
  }
}

}  // namespace dynid::detail
