// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <vector>

namespace dynid::detail {

/// What the local optimiser is to minimise.
struct LocalTask {
  /// Hard: eqs. (11), (16), (30) and the user's constraints hold with a margin. Else they are penalised by
  /// xi, which leaves them out where xi = 0.
  bool hard = false;
  double xi = 0.0;
  std::vector<int> alternatives;  ///< which one of each constraint
  double scale = 1.0;             ///< phi is multiplied by it, to be of order one
  double prior_weight = 0.0;      ///< of the distance from Prepared::reference(), added to phi
  double pull = 0.0;              ///< of |x - towards|^2, added to phi
  Eigen::VectorXd towards;        ///< in x of Prepared
  const std::atomic<bool>* stop = nullptr;
};

}  // namespace dynid::detail
