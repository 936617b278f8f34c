// SPDX-License-Identifier: Apache-2.0
#include "sigmoid_joint.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlopt.hpp>
#include <vector>

#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

/// Joint j over all logs.
class Differences {
 public:
  Differences(const FitProblem& problem, const RegressionFit& fit, const RowWeights& weights, int j)
      : problem_(problem), j_(j) {
    Eigen::Index total = 0;
    for (const RegressionRows& r : problem.rows()) total += r.size();
    d.resize(total);
    dq.resize(total);
    w.resize(total);
    Eigen::Index row = 0;
    for (std::size_t l = 0; l < problem.rows().size(); ++l) {
      const RegressionRows& rows = problem.rows()[l];
      d.segment(row, rows.size()) = problem.difference(fit, rows, j);
      dq.segment(row, rows.size()) = rows.velocity(j);
      w.segment(row, rows.size()) = weights[l].col(j);
      row += rows.size();
    }
  }

  struct Trial {
    double cost = std::numeric_limits<double>::infinity();
    Eigen::Vector3d x;        ///< fv, fo, phi1
    Eigen::MatrixXd columns;  ///< with phi1 = 1
  };
  /// The best fv, fo, phi1 for given (phi2, phi3).
  Trial project(double phi2, double phi3) const {
    Trial trial;
    trial.columns = columns({1.0, phi2, phi3});
    const Eigen::MatrixXd A = w.asDiagonal() * trial.columns.leftCols<3>();
    const Eigen::VectorXd b = w.cwiseProduct(d);
    trial.x = A.colPivHouseholderQr().solve(b);
    trial.cost = (A * trial.x - b).squaredNorm();
    return trial;
  }

  Eigen::VectorXd d, dq, w;  ///< differences [N m], velocities [rad/s], weights

 private:
  /// d tau_f / d(fv, fo, phi1, phi2, phi3).
  Eigen::MatrixXd columns(const SigmoidFriction& phi) const {
    Eigen::MatrixXd columns(d.size(), 5);
    Eigen::Index row = 0;
    for (const RegressionRows& r : problem_.rows()) {
      columns.middleRows(row, r.size()) = r.velocity_columns(j_, 5, [&](double v) {
        Eigen::RowVectorXd values(5);
        values << v, 1.0, friction_regressor(phi, v);
        return values;
      });
      row += r.size();
    }
    return columns;
  }

  const FitProblem& problem_;
  int j_;
};

/// (log phi2, phi3) of least cost. The middle of the curve sits near zero velocity; its sharpness may be
/// anything between a line and a step.
std::vector<double> search_shape(const Differences& joint, double velocity_scale) {
  const double sharpest = 2.0 / std::max(velocity_scale, 0.005);  // no sharper than the smoothed sign
  const double fastest = std::max(joint.dq.cwiseAbs().maxCoeff(), 1e-3);
  const auto cost = [&](const std::vector<double>& p) { return joint.project(std::exp(p[0]), p[1]).cost; };
  using Cost = decltype(cost);
  std::vector<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (double start : {0.1 * sharpest, 0.3 * sharpest, 0.9 * sharpest}) {
    nlopt::opt search(nlopt::LN_BOBYQA, 2);
    search.set_min_objective([](const std::vector<double>& p, std::vector<double>&,
                                void* data) { return (*static_cast<Cost*>(data))(p); },
                             const_cast<void*>(static_cast<const void*>(&cost)));
    search.set_lower_bounds(std::vector<double>{std::log(0.5 / fastest), -0.5 * fastest});
    search.set_upper_bounds(std::vector<double>{std::log(sharpest), 0.5 * fastest});
    search.set_ftol_rel(1e-8);
    search.set_maxeval(150);
    std::vector<double> p = {std::clamp(std::log(start), std::log(0.5 / fastest), std::log(sharpest)), 0.0};
    double value = 0.0;
    try {
      search.optimize(p, value);
    } catch (const nlopt::roundoff_limited&) {  // as good as it gets: p holds the best point
    }
    value = cost(p);
    if (value < least) {
      least = value;
      best = p;
    }
  }
  return best;
}

}  // namespace

SigmoidJoint fit_sigmoid(const FitProblem& problem, const RegressionFit& fit, const RowWeights& weights,
                         int j) {
  const Differences joint(problem, fit, weights, j);
  const std::vector<double> best = search_shape(joint, problem.options().velocity_scale);
  const Differences::Trial trial = joint.project(std::exp(best[0]), best[1]);
  SigmoidJoint out;
  out.friction.linear = {trial.x[0], 0.0, trial.x[1], 0.0};
  out.friction.sigmoid = {trial.x[2], std::exp(best[0]), best[1]};
  Eigen::MatrixXd J = joint.w.asDiagonal() * trial.columns;
  J.rightCols<2>() *= trial.x[2];  // they were made with phi1 = 1
  const double free = std::max(1.0, double((joint.w.array() != 0.0).count()) - 5.0);
  const double variance = fit.correlation[j] * trial.cost / free;
  out.covariance =
      variance * Eigen::MatrixXd(J.transpose() * J).completeOrthogonalDecomposition().pseudoInverse();
  return out;
}

}  // namespace dynid::detail
