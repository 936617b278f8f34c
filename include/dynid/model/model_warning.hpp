// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// Something in a robot's description that is likely a mistake of whoever wrote it, though it can be computed
/// with.
struct ModelWarning {
  /// missing_inertial, mass_unit, torque_limit, placeholder_damping, placeholder_inertial
  std::string name;
  std::vector<int> joints;  ///< from 1; empty when it concerns the whole robot
  double value = 0.0;       ///< what was found: mass [kg], limit [N m], damping [N m s/rad]
  std::string text;         ///< one sentence: what, and what follows
};

/// Looks for: a moving link without inertial; masses in grams (a mean density beyond steel's over the arm's
/// reach); a torque limit that is a small part of what gravity alone asks for; the same round damping on
/// every joint, or the same inertial on every link, which nobody measured. Deterministic. Throws Error where
/// validate() does.
std::vector<ModelWarning> check_model(const Robot& robot);

}  // namespace dynid
