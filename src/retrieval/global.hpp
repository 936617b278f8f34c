// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>

#include "prepared.hpp"

namespace dynid::detail {

/// NLopt's `algorithm` on f = phi + xi gamma over the box LB <= p <= UB, from `p`. Never worse than `p`.
Eigen::VectorXd solve_global(const Prepared& prepared, const Eigen::VectorXd& p, double xi,
                             GlobalAlgorithm algorithm, int evaluations, std::uint64_t seed,
                             const std::atomic<bool>* stop);

}  // namespace dynid::detail
