// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_joint_fit.hpp"

namespace dynid::detail {

/// One effect of a joint's set, weighed.
struct WeighedServoEffect {
  int effect = 0;     ///< of servo_effects()
  double gain = 0.0;  ///< log evidence beyond its price that goes with it
  /// Log evidence of the set with another in its place, less that of the set; and that other's name.
  std::vector<std::pair<double, std::string>> rivals;
};

/// What the search of one joint found.
struct ServoChoice {
  std::vector<WeighedServoEffect> effects;
  KnobFit fit;            ///< with them, on the rows searched
  double evidence = 0.0;  ///< with them
  double samples = 0.0;
  std::vector<std::pair<std::string, double>> alone;  ///< of each effect alone: name, part of the loss gone
};

/// Effects that a joint's rows ask for. `withhold`: names left out.
ServoChoice search_servo(const ServoProblemOfJoint& p, const std::vector<std::string>& withhold,
                         const ServoCriteria& criteria);

/// The choice of a joint whose motion is as the nominal model's: none, the model within its tolerance.
ServoChoice no_servo_effect(const ServoProblemOfJoint& p);

/// The knobs that effects free.
std::vector<Knob> freed(const std::vector<int>& effects);
/// Log evidence that an effect costs.
double price_of(int effect, double samples);

}  // namespace dynid::detail
