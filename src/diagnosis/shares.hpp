// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "search.hpp"

namespace dynid::detail {

/// What each effect takes of the explained energy, averaged over the orders in which they may come (Shapley;
/// Lindeman, Merenda and Gold 1980), of a sum of 1. Exact: 2^k fits.
std::vector<double> shapley_shares(const Search& search, const GapModel& model, const Eigen::VectorXd& floor);

}  // namespace dynid::detail
