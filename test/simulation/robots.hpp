// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>

#include "dynid/model/yaml.hpp"

namespace dynid::test {

inline Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

/// The Panda as bodies alone: no friction, no rotor inertia.
inline Robot frictionless_panda() {
  Robot robot = panda();
  for (Joint& joint : robot.joints) joint.friction = {};
  return robot;
}

/// The Panda with bodies that MuJoCo accepts: it refuses principal moments that break the triangle
/// inequality in the last digit, as those published do after rounding.
inline Robot panda_with_bodies() {
  Robot robot = frictionless_panda();
  for (Joint& joint : robot.joints) {
    LinkInertia link = from_standard(joint.parameters);
    link.inertia += (0.02 * link.inertia.trace() + 1e-3) * Eigen::Matrix3d::Identity();
    joint.parameters = to_standard(link);
  }
  return robot;
}

inline double rms(const Eigen::MatrixXd& x) { return std::sqrt(x.squaredNorm() / double(x.size())); }

}  // namespace dynid::test
