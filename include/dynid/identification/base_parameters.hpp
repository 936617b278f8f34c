// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// The dynamic coefficients (base parameters) of a chain: pi_R = K pi, and tau = Y_R pi_R for every motion.
///
/// pi holds the P standard parameters: 10 n, links base to tip, each in the order of StandardParameters;
/// then, when rotor inertias are included, the n of them. Y_R is Y with the columns `columns` only: the
/// leftmost independent ones in that order (the letter's choice), so a coefficient takes its name from its
/// leading parameter.
struct BaseParameters {
  std::vector<int> columns;              ///< r column numbers, increasing
  std::vector<std::string> names;        ///< r: `zz1`, `mx2`, ..., `ia3`
  std::vector<std::string> expressions;  ///< r: `yy2 + zz1`: the row of K in words
  Eigen::MatrixXd K;                     ///< r x P
  int standard = 0;                      ///< 10 n
  bool rotor_inertia = false;

  int size() const noexcept { return static_cast<int>(columns.size()); }  ///< r
  int parameters() const noexcept { return static_cast<int>(K.cols()); }  ///< P
  int rigid() const noexcept;  ///< how many of `columns` are < 10 n
};

/// Numerical regrouping (Gautier 1991) on the joint-torque regressor at seeded random states. A column whose
/// part independent of those to its left is below 1e-7 of it is dependent: no motion would excite it to any
/// use. Throws Error when the robot is not valid.
BaseParameters base_parameters(const Robot& robot, bool rotor_inertia = false);

/// Name of standard parameter k (from 0): `m1`, `zz7`; beyond 10 n: `ia1`...
std::string parameter_name(int k, int joints);

/// pi (P) of a robot: standard parameters, then rotor inertias when `base` has them.
Eigen::VectorXd parameter_vector(const Robot& robot, const BaseParameters& base);

/// The parameters nearest `start` (Euclidean norm over the P parameters) with K pi = `coefficients` (r).
Eigen::VectorXd nearest_parameters(const BaseParameters& base, const Eigen::VectorXd& coefficients,
                                   const Eigen::VectorXd& start);

/// pi that is zero but for the leading parameters, which hold the coefficients (r): the Lagrangian form of
/// eqs. (22) and (23) from coefficients alone. Every kernel gives M, S, g and tau with it, though no link is
/// a body by itself.
Eigen::VectorXd leading_parameters(const BaseParameters& base, const Eigen::VectorXd& coefficients);

}  // namespace dynid
