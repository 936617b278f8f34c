// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "local_task.hpp"
#include "prepared.hpp"

namespace dynid::detail {

struct LocalSolution {
  Eigen::VectorXd p;
  int iterations = 0;
  bool converged = false;
};

/// Solves LocalProblem by Ipopt, from `p`. Where Ipopt finds nothing, `p` comes back. Any number of threads
/// may call it; one solve runs at a time.
LocalSolution solve_local(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task);

}  // namespace dynid::detail
