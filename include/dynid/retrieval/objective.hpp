// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace dynid {

/// phi of Algorithm 1 as a quadratic in the standard parameters pi (10 n, order of link_inertia.hpp):
/// |W (A pi - b)|^2 + constant, with W diagonal.
class Objective {
 public:
  Objective() = default;

  /// Two steps, eq. (29): |K pi - pi_hat|^2 over the coefficients kept. `K` is r x 10 n, a row per
  /// coefficient; `pi_hat` r. `weights` (r, > 0; empty: ones) multiply the rows, for instance by 1/standard
  /// deviation. Throws Error on sizes and non-finite entries.
  static Objective two_step(const Eigen::MatrixXd& K, const Eigen::VectorXd& pi_hat,
                            const Eigen::VectorXd& weights = {});

  /// One step: |Y [pi; x] - tau|^2 on the triangular factor [R | z] of [Y | tau], `residual_energy` being
  /// what the factor leaves, so that the cost does not depend on the number of samples. The first
  /// `parameters` (10 n) columns of `R` are the standard parameters'; the others (friction) are free and
  /// eliminated: see linear_unknowns(). Weighted by the inverse of the energy that no parameters explain (at
  /// least 1e-6 of what they do).
  static Objective one_step(const Eigen::MatrixXd& R, const Eigen::VectorXd& z, double residual_energy,
                            int parameters);

  int parameters() const noexcept { return static_cast<int>(A_.cols()); }

  /// |A pi - b|^2 + constant, unweighted.
  double value(const Eigen::VectorXd& pi) const;
  /// The weighted value that is minimised: |W (A pi - b)|^2 + weighted_constant().
  double weighted_value(const Eigen::VectorXd& pi) const;
  /// Gradient of weighted_value().
  Eigen::VectorXd weighted_gradient(const Eigen::VectorXd& pi) const;

  /// The unknowns beyond pi (one step: friction, in the order of R's columns) that minimise phi at `pi`.
  Eigen::VectorXd linear_unknowns(const Eigen::VectorXd& pi) const;

  const Eigen::MatrixXd& weighted_matrix() const noexcept { return weighted_A_; }
  const Eigen::VectorXd& weighted_rhs() const noexcept { return weighted_b_; }
  double weighted_constant() const noexcept { return weighted_constant_; }

 private:
  Eigen::MatrixXd A_, weighted_A_;
  Eigen::VectorXd b_, weighted_b_;
  double constant_ = 0.0, weighted_constant_ = 0.0;
  Eigen::MatrixXd unknowns_of_pi_;  // x = unknowns_offset_ - unknowns_of_pi_ * pi
  Eigen::VectorXd unknowns_offset_;
};

}  // namespace dynid
