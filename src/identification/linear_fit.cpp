// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "fit_problem.hpp"
#include "noise.hpp"
#include "prune.hpp"
#include "row_weights.hpp"

namespace dynid::detail {
namespace {

/// Weights of method wls for given factors, one a joint; ones for ols.
std::vector<double> joint_weights(const std::vector<RowGroup>& groups, Method method,
                                  const RowWeights& row_weights) {
  std::vector<double> weights(groups.size(), 1.0);
  if (method == Method::ols) return weights;
  for (int pass = 0; pass < 5; ++pass) {
    const Eigen::VectorXd x = solve(merged(groups, weights));
    for (std::size_t j = 0; j < groups.size(); ++j) {
      const TriangularFactor& factor = groups[j].factor;
      const double misfit = (factor.R() * x - factor.z()).squaredNorm() + factor.residual();
      const double rows = double(rows_in(row_weights, static_cast<int>(j)));
      weights[j] = 1.0 / std::sqrt(std::max(misfit / rows, 1e-16));
    }
  }
  return weights;
}

/// Huber's weights on top of `fit`, iterated; the factors of the groups then hold weighted rows.
void reweight(const FitProblem& problem, const RowWeights& row_weights, RegressionFit& fit) {
  for (int pass = 0; pass < 10; ++pass) {
    const RowWeights robust = huber_weights(row_weights, problem.residuals(fit, problem.rows()));
    fit.groups = problem.groups(robust);
    fit.weights = joint_weights(fit.groups, Method::wls, robust);
    fit.x = solve(merged(fit.groups, fit.weights));
  }
}

}  // namespace

RegressionFit fit_linear(const FitProblem& problem, const RowWeights& weights) {
  const Method method = problem.options().method;
  RegressionFit fit;
  fit.sigmoid.resize(static_cast<std::size_t>(problem.joints()));
  fit.groups = problem.groups(weights);
  fit.unweighted = merged(fit.groups, std::vector<double>(fit.groups.size(), 1.0));
  check_excitation(fit.unweighted, problem.names());
  fit.weights = joint_weights(fit.groups, method, weights);
  fit.x = solve(merged(fit.groups, fit.weights));
  if (method == Method::irls) reweight(problem, weights, fit);
  set_noise(problem, weights, fit);
  prune(problem, weights, fit);
  return fit;
}

std::pair<Eigen::VectorXd, Eigen::MatrixXd> unpruned(const RegressionFit& fit) {
  return {solve(merged(fit.groups, fit.weights)), covariance(fit.groups, fit.weights)};
}

}  // namespace dynid::detail
