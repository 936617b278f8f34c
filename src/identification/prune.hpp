// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "fit_problem.hpp"
#include "row_weights.hpp"

namespace dynid::detail {

/// Backward elimination; sets `fit.x`, `fit.kept` and `fit.covariance`. `fit.groups` have their noise.
///
/// The letter's rule comes with the letter's statistic, which takes every sample for an independent one; its
/// 30 % are several times as much once correlation is honoured. So a coefficient goes only if, on the honest
/// scale too, dropping it saves more than it costs: |x| < sqrt(2) sigma, Akaike's price.
void prune(const FitProblem& problem, const RowWeights& weights, RegressionFit& fit);

}  // namespace dynid::detail
