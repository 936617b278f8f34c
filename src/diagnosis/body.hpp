// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/model/link_inertia.hpp"

namespace dynid::detail {

/// A rigid body can have these standard parameters: the pseudo-inertia has no negative eigenvalue.
bool is_body(const StandardParameters& p);
/// The body nearest to `c` in the norm of `information` (10 x 10): Newton's method along the central path of
/// (x - c)^T I (x - c) - log det P(x) / t, P the pseudo-inertia.
StandardParameters nearest_body(const StandardParameters& c, const Eigen::MatrixXd& information);

}  // namespace dynid::detail
