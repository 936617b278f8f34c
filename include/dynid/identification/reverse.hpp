// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/model/coefficient.hpp"

namespace dynid {

/// Numerical values of a controller's model at N configurations, eq. (19).
struct ModelSamples {
  std::string source;
  Eigen::MatrixXd q;  ///< N x n [rad or m]
  Eigen::MatrixXd s;  ///< N x (n(n+1)/2 + n): lower triangle of M row by row, then g: eq. (17)
};

/// Reads `q1..qn, m11, m21, m22, m31, ..., g1..gn` (CSV). Throws Error as read_table(), or naming a missing
/// column.
ModelSamples read_model_samples(const std::string& path, int joints);

struct ReverseOptions {
  double prune_percent = 30.0;  ///< as in IdentifyOptions
};

struct ReverseIdentification {
  Robot robot;  ///< with the parameters nearest the given ones that have the coefficients; without friction,
                ///< which M and g do not show
  BaseParameters base;
  std::vector<Coefficient> coefficients;
  Eigen::VectorXd values;      ///< r, 0 where dropped
  Eigen::MatrixXd covariance;  ///< r x r, rows taken as independent; zeros where dropped
  int rank = 0;
  double condition_number = 0.0;
  double relative_error_percent = 0.0;
  Eigen::VectorXd rmse;                            ///< n [N m]: gravity torques
  Eigen::VectorXd rmse_inertia;                    ///< n [kg m^2]: row j of the inertia matrix
  double validation_relative_error_percent = 0.0;  ///< on every fifth sample, left out of a second fit
  Eigen::VectorXd validation_rmse;                 ///< n [N m]
};

/// Section IV-A: the coefficients from M(q) and g(q), eqs. (17)-(21). The gravity row of joint 1 is left out
/// when its axis is parallel to gravity, since it is then zero whatever the coefficients. Throws Error: too
/// few samples, or configurations that do not determine every coefficient (they are named).
ReverseIdentification reverse_engineer(const Robot& robot, const ModelSamples& samples,
                                       const ReverseOptions& options = {});

}  // namespace dynid
