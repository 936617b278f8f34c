// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/retrieval/constraint.hpp"

namespace dynid::detail {

/// The indices that h depends on, `parameters` being 10 n.
std::vector<int> variables(const Inequality& h, int parameters);

/// dh/dp and d2h/dp2 over variables(h), given or by differences.
Eigen::VectorXd gradient(const Inequality& h, const Eigen::VectorXd& p);
Eigen::MatrixXd hessian(const Inequality& h, const Eigen::VectorXd& p);

}  // namespace dynid::detail
