// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/identification/base_parameters.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// What a robot is: joints, limits, which of its parameters show in its torques.
struct InfoJob {
  Robot robot;
  bool rotor_inertia = false;  ///< count reflected rotor inertias among the parameters
};

/// How the torques show a parameter.
enum class Identifiable {
  alone,           ///< by itself
  in_combination,  ///< in a sum with others
  no,              ///< not at all
};

struct InfoReport {
  Robot robot;
  BaseParameters base;
  std::vector<Identifiable> parameters;  ///< of base.parameters(), in their order
  std::vector<Inconsistency> broken;     ///< rules of eqs. (11) and (16); empty: physically consistent
  double total_mass = 0.0;               ///< [kg] of the moving links
};

/// Allocates. Throws Error as base_parameters(), Stopped.
InfoReport run(const InfoJob& job, const Context& context = {});

}  // namespace dynid
