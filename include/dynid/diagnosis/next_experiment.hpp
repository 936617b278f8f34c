// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// The experiment that would make the answer stronger.
struct NextExperiment {
  std::string text;                                            ///< for a person
  std::vector<std::pair<std::string, std::string>> separates;  ///< effects that it tells apart
  Trajectory motion;  ///< to run; no samples where none helps. Obstacles were not looked at
};

}  // namespace dynid
