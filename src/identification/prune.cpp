// SPDX-License-Identifier: Apache-2.0
#include "prune.hpp"

#include <cmath>
#include <numeric>
#include <vector>

namespace dynid::detail {
namespace {

/// Index of the coefficient to drop next; -1: none.
Eigen::Index worst_of(const Eigen::VectorXd& x, const Eigen::VectorXd& textbook,
                      const Eigen::VectorXd& honest, double prune_percent) {
  Eigen::Index worst = -1;
  double most = 0.0;
  for (Eigen::Index k = 0; k < x.size() && prune_percent > 0.0; ++k) {
    const double percent = 100.0 * std::sqrt(textbook[k]) / std::abs(x[k]);
    if (percent <= prune_percent || x[k] * x[k] >= 2.0 * honest[k] || percent <= most) continue;
    most = percent;
    worst = k;
  }
  return worst;
}

}  // namespace

void prune(const FitProblem& problem, const RowWeights& weights, RegressionFit& fit) {
  const double per_sample = double(rows_in(weights, 0)) / double(problem.samples());
  fit.kept.resize(static_cast<std::size_t>(problem.columns()));
  std::iota(fit.kept.begin(), fit.kept.end(), 0);
  while (true) {
    std::vector<RowGroup> part = fit.groups;
    for (RowGroup& group : part) group.factor = group.factor.restricted(fit.kept);
    const Eigen::VectorXd x = solve(merged(part, fit.weights));
    fit.covariance = covariance(part, fit.weights);
    for (RowGroup& group : part) group.correlation = 1.0;
    const Eigen::VectorXd textbook = per_sample * covariance(part, fit.weights).diagonal();
    const Eigen::Index worst =
        worst_of(x, textbook, fit.covariance.diagonal(), problem.options().prune_percent);
    if (worst < 0) {
      fit.x = Eigen::VectorXd::Zero(problem.columns());
      fit.x(fit.kept) = x;
      return;
    }
    fit.kept.erase(fit.kept.begin() + worst);
  }
}

}  // namespace dynid::detail
