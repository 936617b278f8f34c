// SPDX-License-Identifier: Apache-2.0
#include "friction_choice.hpp"

#include <cmath>

#include "sigmoid_joint.hpp"

namespace dynid::detail {
namespace {

/// Held-out energy of the residuals [N^2 m^2] under either law, n each, over `count` rows.
struct HeldOut {
  Eigen::VectorXd linear, sigmoid;
  double count = 0.0;
};

HeldOut held_out_energy(const FitProblem& problem, const RowWeights& weights) {
  constexpr int folds = 5;
  const int n = problem.joints();
  HeldOut sum{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), 0.0};
  for (int fold = 0; fold < folds; ++fold) {
    const auto out = [fold](int block) { return block == fold; };
    const RowWeights inside = without(problem.rows(), weights, folds, out),
                     outside = only(problem.rows(), weights, folds, out);
    RegressionFit part = fit_linear(problem, inside);
    const FitQuality a = problem.quality(part, problem.rows(), outside, "");
    for (int j = 0; j < n; ++j)
      part.sigmoid[static_cast<std::size_t>(j)] = fit_sigmoid(problem, part, inside, j);
    const FitQuality b = problem.quality(part, problem.rows(), outside, "");
    sum.linear += double(a.rows) * a.rmse.cwiseAbs2();
    sum.sigmoid += double(b.rows) * b.rmse.cwiseAbs2();
    sum.count += double(a.rows);
    if (problem.options().progress)
      problem.options().progress("choosing the friction laws", double(fold + 1) / folds);
  }
  return sum;
}

}  // namespace

RegressionFit fit_with_choice(const FitProblem& problem, const RowWeights& weights,
                              std::vector<FrictionComparison>* report) {
  constexpr double worth_it = 0.98;  // two more parameters must earn two per cent of the held-out error
  RegressionFit fit = fit_linear(problem, weights);
  if (problem.options().friction != FrictionLaw::sigmoid) return fit;
  const HeldOut held_out = held_out_energy(problem, weights);
  for (int j = 0; j < problem.joints(); ++j) {
    const double linear = held_out.linear[j], sigmoid = held_out.sigmoid[j];
    const bool better = sigmoid < worth_it * worth_it * linear;
    if (better) fit.sigmoid[static_cast<std::size_t>(j)] = fit_sigmoid(problem, fit, weights, j);
    if (report)
      report->push_back({j + 1, std::sqrt(linear / held_out.count), std::sqrt(sigmoid / held_out.count),
                         better ? FrictionLaw::sigmoid : FrictionLaw::linear});
  }
  return fit;
}

}  // namespace dynid::detail
