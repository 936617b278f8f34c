// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "dynid/model/robot.hpp"

namespace dynid::detail {

/// Of each joint, the largest of x (n) over the joints that slide as it does, or turn as it does: the torques
/// of the others have another unit.
inline Eigen::VectorXd largest_alike(const Robot& robot, const Eigen::VectorXd& x) {
  double largest[2] = {0.0, 0.0};
  const auto slides = [&robot](Eigen::Index j) {
    return robot.joints[static_cast<std::size_t>(j)].type == JointType::prismatic ? 1 : 0;
  };
  for (Eigen::Index j = 0; j < x.size(); ++j) largest[slides(j)] = std::max(largest[slides(j)], x[j]);
  Eigen::VectorXd out(x.size());
  for (Eigen::Index j = 0; j < x.size(); ++j) out[j] = largest[slides(j)];
  return out;
}

}  // namespace dynid::detail
