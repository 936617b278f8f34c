// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "local_layout.hpp"
#include "local_point.hpp"
#include "local_task.hpp"
#include "prepared.hpp"

namespace dynid::detail {

/// The smooth problem that the local optimiser solves, with exact first and second derivatives (those of the
/// user's constraints as given): minimise scale (phi + xi sum t + prior and pull) subject to the rows of
/// LocalLayout. The exterior penalties of eq. (32) are stated exactly, by a slack t >= 0 each, with
/// h(p) + t >= 0; eq. (16) as I_Sigma + t 1 >= 0, through the pivots of its Cholesky factor, which are smooth
/// and concave where the largest eigenvalue is not smooth.
///
/// Every function takes a point `x` (layout().columns()) and returns false where it is not defined there.
/// Calls at one point share what they need. Not for two threads at once; all arguments of the constructor are
/// the caller's and outlive it.
class LocalProblem {
 public:
  /// `start` (p): where the optimiser starts.
  LocalProblem(const Prepared& prepared, const LocalTask& task, const Eigen::VectorXd& start)
      : prepared_(prepared), task_(task), layout_(prepared, task, start), point_(prepared, layout_) {}
  LocalProblem(const LocalProblem&) = delete;
  LocalProblem& operator=(const LocalProblem&) = delete;

  const LocalLayout& layout() const noexcept { return layout_; }

  bool objective(const double* x, double& f);
  bool gradient(const double* x, double* g);     ///< of the objective: columns()
  bool constraints(const double* x, double* g);  ///< rows()
  /// Nonzeros of their Jacobian, in the order of LocalLayout::jacobian_rows().
  bool jacobian(const double* x, double* values);

  /// Nonzeros of the lower triangle of the Lagrangian's Hessian, factor objective + sum lambda_k row_k.
  bool hessian(const double* x, double factor, const double* lambda, double* values);
  int hessian_size() const noexcept;
  void hessian_pattern(int* rows, int* columns) const;  ///< hessian_size() each

 private:
  Eigen::MatrixXd objective_hessian();
  double* pivot_jacobian(const std::vector<Pivots>& pivots, double* out) const;
  double* body_jacobian(double* out);
  void add_body_hessian(const double* multiplier, Eigen::MatrixXd& H);

  const Prepared& prepared_;
  const LocalTask& task_;
  LocalLayout layout_;
  LocalPoint point_;
};

}  // namespace dynid::detail
