// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/effect/complete.hpp"
#include "dynid/effect/parse.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// From where draw_effect() draws a parameter, for an arm like the Panda.
struct EffectDraw {
  /// How the strength scales what was drawn.
  enum class Scale { none, times, divided };

  std::string key;
  std::vector<double> low, high;  ///< as many as the parameter's default
  bool either_sign = false;       ///< what was drawn gets a random sign
  Scale scale = Scale::none;
  bool once = false;  ///< all joints share what was drawn
};

/// The ranges of effect `name`, in the order in which they are drawn; what is not listed stays at its
/// default. Throws Error on an unknown name.
const std::vector<EffectDraw>& effect_draws(const std::string& name);

/// A random effect of that name: joints and parameters within effect_draws(), completed.
/// `strength` scales the torque that it makes (1: as the ranges say; 0.3: weak); `duration` [s] is
/// that of the motion, for what happens in a window. The same for the same seed. Throws Error on an unknown
/// name and on a robot with too few joints.
Effect draw_effect(const std::string& name, const Robot& robot, unsigned long seed, double strength = 1.0,
                   double duration = 20.0);

}  // namespace dynid
