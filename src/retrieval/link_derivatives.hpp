// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "pivots.hpp"

namespace dynid::detail {

/// Derivatives of one link's (m, c, I), mass, centre of mass and inertia about it, eq. (26), by its standard
/// parameters x. Both need a mass above 0; any units.
Matrix10 link_jacobian(const Eigen::Ref<const Vector10>& x);

/// sum_k weight_k d2(m, c, I)_k / dx2.
Matrix10 link_hessian(const Eigen::Ref<const Vector10>& x, const Eigen::Ref<const Vector10>& weight);

}  // namespace dynid::detail
