// SPDX-License-Identifier: Apache-2.0
#include "noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace dynid::detail {
namespace {

/// Residuals of joint j where its weight is not 0, one entry a stretch without gaps.
std::vector<Eigen::VectorXd> stretches(const FitProblem& problem, const RowWeights& weights,
                                       const std::vector<Eigen::MatrixXd>& e, int j) {
  std::vector<Eigen::VectorXd> parts;
  for (std::size_t l = 0; l < e.size(); ++l) {
    const std::vector<Eigen::Index>& first = problem.rows()[l].parts();
    for (std::size_t p = 0; p + 1 < first.size(); ++p) {
      std::vector<double> x;
      for (Eigen::Index i = first[p]; i < first[p + 1]; ++i)
        if (weights[l](i, j) != 0.0) x.push_back(e[l](i, j));
      parts.emplace_back(Eigen::Map<Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())));
    }
  }
  return parts;
}

}  // namespace

void set_noise(const FitProblem& problem, const RowWeights& weights, RegressionFit& fit) {
  const std::vector<Eigen::MatrixXd> e = problem.residuals(fit, problem.rows());
  const int n = problem.joints();
  fit.noise.resize(n);
  fit.correlation.resize(n);
  for (int j = 0; j < n; ++j) {
    const std::vector<Eigen::VectorXd> parts = stretches(problem, weights, e, j);
    double sum = 0.0;
    for (const Eigen::VectorXd& part : parts) sum += part.squaredNorm();
    const double free = std::max(1.0, double(rows_in(weights, j)) - double(problem.columns()) / n);
    RowGroup& group = fit.groups[static_cast<std::size_t>(j)];
    group.variance = sum / free;
    group.correlation = integrated_autocorrelation(parts);
    fit.noise[j] = std::sqrt(group.variance);
    fit.correlation[j] = group.correlation;
  }
}

}  // namespace dynid::detail
