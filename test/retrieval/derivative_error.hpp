// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "retrieval/local_problem.hpp"

namespace dynid::testing {

/// Compares the derivatives of a LocalProblem with central differences of its functions.
class DerivativeChecker {
 public:
  DerivativeChecker(const detail::Prepared& prepared, const detail::LocalTask& task, const Eigen::VectorXd& p)
      : problem_(prepared, task, p),
        n_(problem_.layout().columns()),
        m_(problem_.layout().rows()),
        lambda_(Eigen::VectorXd::LinSpaced(m_, -1.0, 2.0)) {}

  /// Largest error at the starting point, relative to the largest entry of a gradient or of a column.
  double error() {
    const Eigen::VectorXd x = problem_.layout().start();
    const First given = first(x);
    const Eigen::MatrixXd hessian = this->hessian(x);
    for (int j = 0; j < n_; ++j) {
      const Eigen::VectorXd step = step_ * Eigen::VectorXd::Unit(n_, j);
      const double f = (objective(x + step) - objective(x - step)) / (2 * step_);
      take(std::abs(given.objective[j] - f) / (1e-3 + given.objective.cwiseAbs().maxCoeff()));
      compare(given.jacobian.col(j), (rows(x + step) - rows(x - step)) / (2 * step_));
      // Differences of the Lagrangian's gradient are the columns of its Hessian.
      compare(hessian.col(j), (lagrangian(x + step) - lagrangian(x - step)) / (2 * step_));
    }
    return error_;
  }

 private:
  struct First {
    Eigen::VectorXd objective;
    Eigen::MatrixXd jacobian;
  };

  void take(double error) {
    error_ = std::isfinite(error) ? std::max(error_, error) : std::numeric_limits<double>::infinity();
  }
  void compare(const Eigen::VectorXd& given, const Eigen::VectorXd& differences) {
    take((given - differences).cwiseAbs().maxCoeff() / (1e-3 + given.cwiseAbs().maxCoeff()));
  }

  double objective(const Eigen::VectorXd& x) {
    double f = 0.0;
    take(problem_.objective(x.data(), f) ? 0.0 : std::numeric_limits<double>::infinity());
    return f;
  }
  Eigen::VectorXd rows(const Eigen::VectorXd& x) {
    Eigen::VectorXd g(m_);
    take(problem_.constraints(x.data(), g.data()) ? 0.0 : std::numeric_limits<double>::infinity());
    return g;
  }
  First first(const Eigen::VectorXd& x) {
    First at{Eigen::VectorXd(n_), Eigen::MatrixXd::Zero(m_, n_)};
    const std::vector<int>& r = problem_.layout().jacobian_rows();
    const std::vector<int>& c = problem_.layout().jacobian_columns();
    std::vector<double> values(r.size());
    const bool defined =
        problem_.gradient(x.data(), at.objective.data()) && problem_.jacobian(x.data(), values.data());
    take(defined ? 0.0 : std::numeric_limits<double>::infinity());
    for (std::size_t k = 0; k < values.size(); ++k) at.jacobian(r[k], c[k]) += values[k];
    return at;
  }
  Eigen::VectorXd lagrangian(const Eigen::VectorXd& x) {
    const First at = first(x);
    return at.objective + at.jacobian.transpose() * lambda_;
  }
  Eigen::MatrixXd hessian(const Eigen::VectorXd& x) {
    const auto size = static_cast<std::size_t>(problem_.hessian_size());
    std::vector<int> r(size), c(size);
    std::vector<double> values(size);
    problem_.hessian_pattern(r.data(), c.data());
    take(problem_.hessian(x.data(), 1.0, lambda_.data(), values.data())
             ? 0.0
             : std::numeric_limits<double>::infinity());
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n_, n_);
    for (std::size_t k = 0; k < size; ++k) H(r[k], c[k]) += values[k];
    return H.selfadjointView<Eigen::Lower>();
  }

  static constexpr double step_ = 1e-6;
  detail::LocalProblem problem_;
  int n_, m_;
  Eigen::VectorXd lambda_;
  double error_ = 0.0;
};

/// Largest relative error of the first and second derivatives that the local optimiser is given at `p`.
inline double derivative_error(const detail::Prepared& prepared, const Eigen::VectorXd& p,
                               const detail::LocalTask& task) {
  return DerivativeChecker(prepared, task, p).error();
}

}  // namespace dynid::testing
