// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

#include "dynid/model/link_inertia.hpp"

namespace dynid::detail {

using Vector10 = Eigen::Matrix<double, 10, 1>;
using Matrix10 = Eigen::Matrix<double, 10, 10>;

/// The pseudo-inertia with the mass first, [[m, h^T], [h, Sigma]], is the sum of x_j times these; entry 10 is
/// the direction of eq. (16)'s slack, Sigma + t 1.
const std::array<Eigen::Matrix4d, 11>& pseudo_inertia_basis();

/// The pseudo-inertia, mass first, of a link's standard parameters `x`, with Sigma + shift 1 in place of
/// Sigma. Any units.
Eigen::Matrix4d shifted_pseudo_inertia(const Eigen::Ref<const Vector10>& x, double shift);

/// Pivots d_1..d_3 of a pseudo-inertia P beyond the mass: P is positive definite exactly where the mass and
/// they are positive, and they are smooth and concave there. Derivatives are by the ten unknowns and the
/// slack.
struct Pivots {
  std::array<double, 3> value{};
  std::array<Eigen::Matrix<double, 11, 1>, 3> gradient;
  std::array<Eigen::Matrix<double, 11, 11>, 3> hessian;

  /// False where a leading block of P is not positive definite: the pivots are then undefined.
  bool evaluate(const Eigen::Matrix4d& P, bool derivatives);
};

}  // namespace dynid::detail
