// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <vector>

#include "prepared.hpp"

namespace dynid::detail {

/// What the local optimiser is to minimise.
struct LocalTask {
  /// Hard: eqs. (11), (16), (30) and the user's constraints hold with a margin. Else they are penalised by
  /// xi, which leaves them out where xi = 0.
  bool hard = false;
  double xi = 0.0;
  std::vector<int> alternatives;  ///< which one of each constraint
  double scale = 1.0;             ///< phi is multiplied by it, to be of order one
  double prior_weight = 0.0;      ///< of the distance from Prepared::reference(), added to phi
  double pull = 0.0;              ///< of |x - towards|^2, added to phi
  Eigen::VectorXd towards;        ///< in x of Prepared
  const std::atomic<bool>* stop = nullptr;
};

struct LocalSolution {
  Eigen::VectorXd p;
  int iterations = 0;
  bool converged = false;
};

/// Ipopt from `p`, on the unknowns x of Prepared, with exact first and second derivatives (those of the
/// user's constraints as given). The exterior penalties of eq. (32) are stated exactly, by a slack each:
/// minimise phi + xi sum t with t >= 0 and h(p) + t >= 0; eq. (16) as I_Sigma + t 1 >= 0, through the pivots
/// of its Cholesky factor, which are smooth and concave where the largest eigenvalue is not smooth.
LocalSolution solve_local(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task);

/// Largest relative error of the first and second derivatives that Ipopt is given at `p`, against central
/// differences.
double derivative_error(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task);

/// Distance of `x` from Prepared::reference(), with its gradient and Hessian in x where asked.
double prior_distance(const Prepared& prepared, const Eigen::VectorXd& x, Eigen::VectorXd* gradient = nullptr,
                      Eigen::MatrixXd* hessian = nullptr);

}  // namespace dynid::detail
