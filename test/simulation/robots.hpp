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

/// A SCARA: two links, a quill that slides, and a wrist four orders of magnitude lighter than the arm; dry
/// friction that jumps at zero velocity on every joint.
inline Robot light_wrist_scara() {
  Robot robot;
  robot.name = "scara";
  const auto add = [&robot](const char* name, JointType type, const Eigen::Vector3d& at, double mass,
                            const Eigen::Vector3d& com, double radius, double range, double speed,
                            double torque, double coulomb) {
    Joint joint;
    joint.name = name;
    joint.link_name = std::string(name) + "_link";
    joint.type = type;
    joint.origin.translation() = at;
    LinkInertia link;
    link.mass = mass;
    link.com = com;
    link.inertia = 0.5 * mass * radius * radius * Eigen::Matrix3d::Identity();
    joint.parameters = to_standard(link);
    joint.limits.lower = -range, joint.limits.upper = range;
    joint.limits.velocity = speed, joint.limits.torque = torque;
    joint.friction.linear.coulomb = coulomb;
    joint.friction.linear.viscous = 0.2 * coulomb / speed;
    robot.joints.push_back(joint);
  };
  using V = Eigen::Vector3d;
  add("shoulder", JointType::revolute, V(0, 0, 0.3), 6.0, V(0.18, 0, 0), 0.08, 2.2, 6.0, 90.0, 3.0);
  add("elbow", JointType::revolute, V(0.35, 0, 0), 3.0, V(0.12, 0, 0), 0.06, 2.5, 10.0, 40.0, 1.5);
  add("quill", JointType::prismatic, V(0.25, 0, 0), 0.5, V(0, 0, 0.05), 0.01, 0.08, 1.0, 120.0, 6.0);
  add("wrist", JointType::revolute, V(0, 0, -0.1), 0.1, V(0.001, 0, 0), 0.01, 3.1, 30.0, 2.0, 0.08);
  return robot;
}

inline double rms(const Eigen::MatrixXd& x) { return std::sqrt(x.squaredNorm() / double(x.size())); }

}  // namespace dynid::test
