// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "local_layout.hpp"
#include "pivots.hpp"
#include "prepared.hpp"

namespace dynid::detail {

/// What objective, rows and their derivatives share at one point. Each part is evaluated when it is first
/// asked for, and once: an optimiser asks for values at every trial point, and for derivatives, each of them
/// separately, where it stays.
///
/// Not for two threads at once. `prepared` and `layout` are the caller's and outlive it.
class LocalPoint {
 public:
  LocalPoint(const Prepared& prepared, const LocalLayout& layout) : prepared_(prepared), layout_(layout) {}

  /// Goes to the point `x` (columns of the layout); where it is there already, what is known is kept.
  void move_to(const double* x);

  const Eigen::VectorXd& columns() const noexcept { return columns_; }    ///< unknowns and slacks
  const Eigen::VectorXd& unknowns() const noexcept { return unknowns_; }  ///< x of Prepared

  const Eigen::VectorXd& residual();  ///< A x - b

  struct PriorTerm {
    double distance = 0.0;  ///< infinite where it is not defined
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  double prior();  ///< the distance alone
  const PriorTerm& prior_derivatives();

  /// One a link; null where one is not defined.
  const std::vector<Pivots>* pivots(bool derivatives);

  /// The links as bodies; null where a mass is not positive.
  struct Bodies {
    Eigen::VectorXd scaled;  ///< (m, c, I) of x
    Eigen::VectorXd p;       ///< the same in SI units, as the user's constraints take it
  };
  const Bodies* bodies();

  // Of the bodies, which must exist:
  const std::vector<double>& inequality_values();              ///< h, one an inequality
  const std::vector<Matrix10>& body_jacobians();               ///< d(m, c, I)/dx, one a link
  const std::vector<Eigen::VectorXd>& inequality_gradients();  ///< scaled_gradient(), one an inequality

 private:
  const Prepared& prepared_;
  const LocalLayout& layout_;
  Eigen::VectorXd columns_, unknowns_;
  std::optional<Eigen::VectorXd> residual_;
  std::optional<double> prior_;
  std::optional<PriorTerm> prior_derivatives_;
  std::vector<Pivots> pivots_;
  enum class Known { nothing, values, derivatives } pivots_known_ = Known::nothing;
  bool pivots_defined_ = false;
  std::optional<Bodies> bodies_;
  std::optional<std::vector<double>> values_;
  std::vector<Matrix10> jacobians_;
  std::optional<std::vector<Eigen::VectorXd>> gradients_;
};

}  // namespace dynid::detail
