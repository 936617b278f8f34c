// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "dynid/effect/complete.hpp"

namespace dynid {

/// What enters a robot.
enum class Entering {
  parameters,  ///< inertia, friction, gravity: the links stay where they are
  everything,  ///< the frames of links too: the robot is right for torques along a measured motion
};

/// Puts an effect into the robot itself where that has a place for it (inertia, rotor inertia, friction,
/// gravity), and returns true; else, and where the effect has another name than the catalogue's, returns
/// false and leaves the robot as it is. Throws Error where checked_effect() does.
inline bool enter_effect(Robot& robot, const Effect& effect, Entering what = Entering::parameters) {
  const EffectSchema* const schema = find_effect_schema(effect.name);
  if (schema == nullptr || schema->enter == nullptr) return false;
  if (schema->moves_frames && what == Entering::parameters) return false;
  return schema->enter(robot, checked_effect(effect, robot));
}

/// The robot with those of its effects entered that can be, in their order; the others stay in
/// Robot::effects. Throws Error where checked_effect() does, on those that could enter.
inline Robot with_effects_entered(const Robot& robot, Entering what = Entering::parameters) {
  Robot out = robot;
  out.effects.clear();
  for (const Effect& effect : robot.effects)
    if (!enter_effect(out, effect, what)) out.effects.push_back(effect);
  return out;
}

/// Effects of the robot that the loop cannot compute, each name once, in their order. Throws Error on one
/// that is unknown.
inline std::vector<std::string> uncompensated_effects(const Robot& robot) {
  std::vector<std::string> names;
  for (const Effect& effect : robot.effects)
    if (!effect_schema(effect.name).in_loop() &&
        std::find(names.begin(), names.end(), effect.name) == names.end())
      names.push_back(effect.name);
  return names;
}

}  // namespace dynid
