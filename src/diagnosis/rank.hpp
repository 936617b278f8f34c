// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "judge.hpp"

namespace dynid::detail {

/// Of each effect of a set: how probable it is within the set, and which others could stand in its place.
struct Ranked {
  std::vector<double> probability;
  std::vector<std::vector<std::string>> aliases;
  std::vector<RankedEffect>
      ranking;  ///< of every effect of the library: to be the first, most probable first
};
Ranked rank(const Choice& choice, const Judged& judged, const std::vector<const Hypothesis*>& library);

/// Effects by share, largest first.
std::vector<std::size_t> by_share(const std::vector<double>& shares);

}  // namespace dynid::detail
