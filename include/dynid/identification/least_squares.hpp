// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/identification/triangular_factor.hpp"

namespace dynid {

/// Condition number of the factor's R (ratio of its extreme singular values): that of the stacked regressor,
/// eq. (8).
double condition_number(const TriangularFactor& factor);

/// Throws Error, naming the coefficients (`names`, p) that take part in directions which the rows leave
/// undetermined, when the condition number is above `limit`.
void check_excitation(const TriangularFactor& factor, const std::vector<std::string>& names,
                      double limit = 1e4);

/// Least-squares solution of one factor: x = R^-1 z.
Eigen::VectorXd solve(const TriangularFactor& factor);

/// Rows of one joint (or one kind) as a group with a noise of its own.
struct RowGroup {
  TriangularFactor factor;   ///< of its rows, unweighted, all p columns
  double variance = 1.0;     ///< sigma^2 of one row's residual
  double correlation = 1.0;  ///< integrated autocorrelation: rows that one independent row is worth (>= 1)
};

/// Covariance (p x p) of x when the rows of group g are weighted by weights[g]:
/// G^-1 (sum_g w_g^4 sigma_g^2 c_g G_g) G^-1, with G_g = R_g^T R_g and G = sum_g w_g^2 G_g.
///
/// Correlated residuals are honoured by c_g, the integrated autocorrelation of the group's residual: the
/// regressor's columns vary slowly, so what counts is the residual's power at low frequency, c_g sigma_g^2
/// per row. `weights`: one a group. Allocates, does not throw; with c_g = 1 it is the textbook formula of
/// independent rows.
Eigen::MatrixXd covariance(const std::vector<RowGroup>& groups, const std::vector<double>& weights);

/// Integrated autocorrelation 1 + 2 sum rho_k of consecutive residuals, summed until the pair sums turn
/// negative (Geyer 1992), at least 1. `parts`: contiguous stretches.
double integrated_autocorrelation(const std::vector<Eigen::VectorXd>& parts);

}  // namespace dynid
