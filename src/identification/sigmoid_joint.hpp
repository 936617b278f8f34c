// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "fit_problem.hpp"
#include "row_weights.hpp"

namespace dynid::detail {

/// Eq. (25) with viscous term and offset for the differences of joint j (Section IV-B), by fit_friction();
/// the columns pass through the filter of the rows.
SigmoidJoint fit_sigmoid(const FitProblem& problem, const RegressionFit& fit, const RowWeights& weights,
                         int j);

}  // namespace dynid::detail
