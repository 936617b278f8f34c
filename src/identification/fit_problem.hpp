// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynid/identification/identify.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/identification/regression.hpp"
#include "row_weights.hpp"

namespace dynid::detail {

/// Eq. (25) with viscous term and offset on one joint, the rigid body being given: fv dq + fo + phi(dq).
struct SigmoidJoint {
  JointFriction friction;
  Eigen::Matrix<double, 5, 5> covariance;  ///< of fv, fo, phi1, phi2, phi3
};

/// Least squares with eq. (24) or no friction; then, on some joints, eq. (25) instead.
struct RegressionFit {
  std::vector<RowGroup> groups;  ///< one a joint, all columns
  std::vector<double> weights;   ///< one a joint
  TriangularFactor unweighted;   ///< of all joints
  Eigen::VectorXd x;             ///< rigid body, then friction joint by joint; 0 where dropped
  std::vector<int> kept;         ///< columns that were not dropped, increasing
  Eigen::MatrixXd covariance;    ///< of the kept
  Eigen::VectorXd noise;         ///< n [N m]: standard deviation of a row's residual
  Eigen::VectorXd correlation;   ///< n: rows that one independent row is worth
  std::vector<std::optional<SigmoidJoint>> sigmoid;  ///< n
};

/// The rows of all logs and the columns that are fitted to them: the base parameters, then fv, fc, fo of each
/// joint unless friction is left out.
class FitProblem {
 public:
  /// `base` and `options` are the caller's and outlive it. `samples`: of all logs, before decimation to rows.
  FitProblem(const BaseParameters& base, std::vector<RegressionRows> rows, Eigen::Index samples,
             const IdentifyOptions& options);

  const std::vector<RegressionRows>& rows() const noexcept { return rows_; }
  const IdentifyOptions& options() const noexcept { return options_; }
  Eigen::Index samples() const noexcept { return samples_; }
  int joints() const noexcept { return n_; }
  int columns() const noexcept { return columns_; }
  /// First friction column of joint j.
  int first(int j) const noexcept { return base_.size() + j * own_; }
  /// Of the columns.
  std::vector<std::string> names() const;

  /// What is left of joint j's torque in `rows` without its friction, N [N m].
  Eigen::VectorXd difference(const RegressionFit& fit, const RegressionRows& rows, int j) const;

  /// Rows predicted minus rows measured [N m], N x n, one a log.
  std::vector<Eigen::MatrixXd> residuals(const RegressionFit& fit,
                                         const std::vector<RegressionRows>& rows) const;

  /// How well `fit` predicts the rows whose weight is not 0.
  FitQuality quality(const RegressionFit& fit, const std::vector<RegressionRows>& rows,
                     const RowWeights& weights, const std::string& source) const;

  /// One factor a joint, of all columns.
  std::vector<RowGroup> groups(const RowWeights& weights) const;

 private:
  Eigen::MatrixXd linear_columns(const RegressionRows& rows, int j) const;

  const BaseParameters& base_;
  std::vector<RegressionRows> rows_;
  const IdentifyOptions& options_;
  Eigen::Index samples_;
  int n_, own_, columns_;
};

/// `symbol` with the joint's number from 1: `fv3`.
std::string tag(const char* symbol, int joint);

/// One factor of all groups, the rows of each multiplied by its weight.
TriangularFactor merged(const std::vector<RowGroup>& groups, const std::vector<double>& weights);

/// Least squares by the method of the options; noise and correlation of each joint; pruning. Throws Error,
/// naming the coefficients, where the rows do not determine them.
RegressionFit fit_linear(const FitProblem& problem, const RowWeights& weights);

/// Solution and covariance of `fit` with every column in.
std::pair<Eigen::VectorXd, Eigen::MatrixXd> unpruned(const RegressionFit& fit);

}  // namespace dynid::detail
