// SPDX-License-Identifier: Apache-2.0
#include "sigmoid_joint.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>
#include <vector>

#include "dynid/friction/fit.hpp"

namespace dynid::detail {
namespace {

/// The differences of joint j over all logs; functions of its velocity go through the filter of the rows.
FrictionSamples samples_of(const FitProblem& problem, const RegressionFit& fit, const RowWeights& weights,
                           int j) {
  FrictionSamples s;
  Eigen::Index total = 0;
  for (const RegressionRows& r : problem.rows()) total += r.size();
  s.difference.resize(total);
  s.dq.resize(total);
  s.weight.resize(total);
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < problem.rows().size(); ++l) {
    const RegressionRows& rows = problem.rows()[l];
    s.difference.segment(first, rows.size()) = problem.difference(fit, rows, j);
    s.dq.segment(first, rows.size()) = rows.velocity(j);
    s.weight.segment(first, rows.size()) = weights[l].col(j);
    first += rows.size();
  }
  s.filtered = [&problem, j, total](int columns, const std::function<Eigen::RowVectorXd(double)>& row) {
    Eigen::MatrixXd all(total, columns);
    Eigen::Index next = 0;
    for (const RegressionRows& r : problem.rows()) {
      all.middleRows(next, r.size()) = r.velocity_columns(j, columns, row);
      next += r.size();
    }
    return all;
  };
  return s;
}

/// fv, fo and eq. (25). The middle of the curve sits near zero velocity; its sharpness may be anything
/// between a line and a step, but no sharper than the smoothed sign.
std::vector<FrictionUnknown> unknowns_within(double fastest, double velocity_scale) {
  const double sharpest = 2.0 / std::max(velocity_scale, 0.005);
  return {{"viscous"},
          {"offset"},
          {"phi1"},
          {"phi2", 0.5 / fastest, sharpest},
          {"phi3", -0.5 * fastest, 0.5 * fastest}};
}

}  // namespace

SigmoidJoint fit_sigmoid(const FitProblem& problem, const RegressionFit& fit, const RowWeights& weights,
                         int j) {
  const FrictionSamples samples = samples_of(problem, fit, weights, j);
  const double fastest = std::max(samples.dq.cwiseAbs().maxCoeff(), 1e-3);
  const FrictionFit found =
      fit_friction(samples, JointFriction{}, unknowns_within(fastest, problem.options().velocity_scale));
  SigmoidJoint out;
  out.friction = found.friction;
  const double free = std::max(1.0, double((samples.weight.array() != 0.0).count()) - 5.0);
  const double variance = fit.correlation[j] * found.sum_squares / free;
  out.covariance = variance * found.information.completeOrthogonalDecomposition().pseudoInverse();
  return out;
}

}  // namespace dynid::detail
