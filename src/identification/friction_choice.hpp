// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "fit_problem.hpp"
#include "row_weights.hpp"

namespace dynid::detail {

/// fit_linear(), then, where the options offer it, eq. (25) on the joints where held-out blocks prefer it.
/// `report`, if any, takes the comparison of each joint.
RegressionFit fit_with_choice(const FitProblem& problem, const RowWeights& weights,
                              std::vector<FrictionComparison>* report);

}  // namespace dynid::detail
