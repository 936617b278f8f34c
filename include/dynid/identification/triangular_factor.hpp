// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dynid {

/// The square-root information of a linear regression A x = b: the triangular factor [R | z] of the stacked
/// rows [A | b] and the energy of what no x explains. Its size does not depend on the number of rows; factors
/// of two logs, two threads or two machines merge by the same step.
class TriangularFactor {
 public:
  /// For rows of `columns` = p coefficients.
  explicit TriangularFactor(int columns = 0);

  int columns() const noexcept { return columns_; }     ///< p
  Eigen::Index rows() const noexcept { return rows_; }  ///< rows taken in so far

  /// Takes in rows [A | b] (k x (p + 1), any k) by Householder QR.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& block);
  /// Takes in another factor of as many columns, its rows weighted by `weight` (a standard deviation's
  /// inverse).
  void merge(const TriangularFactor& other, double weight = 1.0);
  /// This factor with its columns at places `where` (p numbers) among `columns` coefficients, zeros
  /// elsewhere.
  TriangularFactor scattered(const std::vector<int>& where, int columns) const;
  /// The factor for the coefficients `kept` (increasing column numbers) alone, the others being zero.
  TriangularFactor restricted(const std::vector<int>& kept) const;

  Eigen::MatrixXd R() const;  ///< p x p, upper triangular
  Eigen::VectorXd z() const;  ///< p: the right-hand side; R x = z is the least-squares problem
  double residual() const;    ///< |A x - b|^2 at the least-squares solution of full rank
  double energy() const;      ///< |b|^2

 private:
  int columns_;
  Eigen::Index rows_ = 0;
  Eigen::MatrixXd factor_;  // (p + 1) x (p + 1), upper triangular
};

}  // namespace dynid
