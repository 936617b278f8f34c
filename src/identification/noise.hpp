// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "fit_problem.hpp"
#include "row_weights.hpp"

namespace dynid::detail {

/// Sets `fit.noise` and `fit.correlation`, and both of each of `fit.groups`: the variance of each joint's
/// residual over the rows of `weights`, and how it is correlated from row to row.
void set_noise(const FitProblem& problem, const RowWeights& weights, RegressionFit& fit);

}  // namespace dynid::detail
