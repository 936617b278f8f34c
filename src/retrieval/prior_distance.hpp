// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "prepared.hpp"

namespace dynid::detail {

/// Distance of `x` (unknowns of Prepared) from Prepared::reference(), summed over the links, with its
/// gradient and Hessian in x where asked. Infinite where a pseudo-inertia is not positive definite and the
/// distance is the entropic one.
double prior_distance(const Prepared& prepared, const Eigen::VectorXd& x, Eigen::VectorXd* gradient = nullptr,
                      Eigen::MatrixXd* hessian = nullptr);

}  // namespace dynid::detail
