// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "select.hpp"

namespace dynid::detail {

/// How probable each effect of a set is within it, and which others could stand in its place.
struct Ranked {
  std::vector<double> probability;  ///< of each effect of the set
  std::vector<double> together;     ///< of it, or of one that is as good in its place
  std::vector<std::vector<std::string>> aliases;
  /// Of every effect of the library: to be the first; most probable first.
  std::vector<RankedEffect> ranking;
  std::vector<Grounds> grounds;  ///< of each effect of the set
  /// The set with one of its effects given up for another that is as good there and more probable.
  std::optional<GapModel> better;
};

/// Compares, for each effect of the set, the set with it, with every other effect in its place, and with
/// nothing there. What the forms of the others are not exact in is variance for all of them: an effect whose
/// gain is below what that could make is not probable. `shares`: of its effects; `floor`: n [N m or N].
Ranked rank(const Choice& choice, const GapModel& model, const std::vector<double>& shares,
            const Eigen::VectorXd& floor, const Calibration& by);

/// Probability that effect `which` of the set is there, if it or nothing in its place is.
double needed(const Choice& choice, const GapModel& model, std::size_t which, const Calibration& by);

/// On every joint where effect `which` of the set acts it is smaller than what the forms of the others are
/// not exact in there.
bool below_form(const Choice& choice, const GapModel& model, std::size_t which);

/// Effects by share, largest first.
std::vector<std::size_t> by_share(const std::vector<double>& shares);

}  // namespace dynid::detail
