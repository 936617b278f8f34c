// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>

#include "dynid/model/robot.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid::test {

using Generator = std::mt19937_64;

inline double uniform(Generator& generator, double lo, double hi) {
  return std::uniform_real_distribution<double>(lo, hi)(generator);
}

inline Eigen::Vector3d random_vector(Generator& generator, double size) {
  return {uniform(generator, -size, size), uniform(generator, -size, size), uniform(generator, -size, size)};
}

inline Eigen::VectorXd random_state(Generator& generator, int n, double size) {
  Eigen::VectorXd x(n);
  for (int i = 0; i < n; ++i) x[i] = uniform(generator, -size, size);
  return x;
}

inline Eigen::Matrix3d random_rotation(Generator& generator) {
  std::normal_distribution<double> normal;
  const double w = normal(generator), x = normal(generator), y = normal(generator), z = normal(generator);
  return Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
}

/// A body that can exist: a few point masses.
inline StandardParameters random_body(Generator& generator) {
  StandardParameters p = StandardParameters::Zero();
  for (int k = 0; k < 5; ++k) {
    LinkInertia point;
    point.mass = uniform(generator, 0.1, 1.0);
    point.com = random_vector(generator, 0.2);
    p += to_standard(point);
  }
  return p;
}

/// The published Panda (modified DH: link frames are the kernels' own).
inline Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

/// A chain in the manner of a UR10e's URDF: axes y and z, origins turned by roll, pitch, yaw, a flange beyond
/// the wrist.
inline Robot ur_like() {
  Generator generator(10);
  struct Row {
    Eigen::Vector3d xyz, rpy, axis;
  };
  const double right = 1.570796325;  // rounded, as URDF files have it
  const Row rows[6] = {{{0, 0, 0.1807}, {0, 0, 0}, {0, 0, 1}},     {{0, 0.176, 0}, {0, right, 0}, {0, 1, 0}},
                       {{0, -0.137, 0.613}, {0, 0, 0}, {0, 1, 0}}, {{0, 0, 0.571}, {0, right, 0}, {0, 1, 0}},
                       {{0, 0.135, 0}, {0, 0, 0}, {0, 0, 1}},      {{0, 0, 0.12}, {0, 0, 0}, {0, 1, 0}}};
  Robot robot;
  robot.name = "ur_like";
  for (const Row& row : rows) {
    Joint joint;
    joint.name = "joint" + std::to_string(robot.size() + 1);
    joint.link_name = "link" + std::to_string(robot.size() + 1);
    joint.type = JointType::revolute;
    joint.axis = row.axis;
    joint.origin.translation() = row.xyz;
    joint.origin.linear() = (Eigen::AngleAxisd(row.rpy.z(), Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(row.rpy.y(), Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(row.rpy.x(), Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
    joint.parameters = random_body(generator);
    robot.joints.push_back(joint);
  }
  robot.tip.translation() = Eigen::Vector3d(0, 0.1168, 0);
  robot.tip.linear() = Eigen::AngleAxisd(-right, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return robot;
}

/// 2 to 9 joints of all three kinds; axes that are anything, a coordinate axis, or parallel, antiparallel, or
/// all but parallel to the one before; any gravity.
inline Robot random_chain(unsigned seed) {
  Generator generator(seed);
  Robot robot;
  robot.name = "random_chain_" + std::to_string(seed);
  const int n = 2 + static_cast<int>(seed % 8);
  const auto pick = [&](int kinds) { return std::uniform_int_distribution<int>(0, kinds - 1)(generator); };
  for (int i = 0; i < n; ++i) {
    Joint joint;
    joint.name = "joint" + std::to_string(i + 1);
    joint.link_name = "link" + std::to_string(i + 1);
    const int kind = pick(4);
    joint.type = kind == 0 ? JointType::prismatic : kind == 1 ? JointType::continuous : JointType::revolute;
    if (pick(4) > 0) joint.origin.linear() = random_rotation(generator);
    if (pick(4) > 0) joint.origin.translation() = random_vector(generator, 0.6);
    switch (pick(4)) {
      case 0:
        joint.axis = random_vector(generator, 1.0).normalized();
        break;
      case 1:
        joint.axis = (pick(2) == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(pick(3));
        break;
      default: {  // beside the axis before
        const Eigen::Vector3d before = i > 0 ? robot.joints.back().axis : Eigen::Vector3d::UnitZ();
        const double off[4] = {0.0, 1e-15, 1e-9, 1e-4};
        const Eigen::Vector3d beside = before + off[pick(4)] * random_vector(generator, 1.0);
        joint.axis = (joint.origin.linear().transpose() * beside).normalized() * (pick(2) == 0 ? 1.0 : -1.0);
      }
    }
    joint.parameters = random_body(generator);
    robot.joints.push_back(joint);
  }
  robot.tip.linear() = random_rotation(generator);
  robot.tip.translation() = random_vector(generator, 0.3);
  robot.gravity = random_vector(generator, 12.0);
  return robot;
}

/// States in all for a campaign over one robot, or over the hundred chains together: DYNID_TEST_STATES or
/// `usual`.
inline int states(int usual) {
  const char* text = std::getenv("DYNID_TEST_STATES");
  return text != nullptr ? std::max(1, std::atoi(text)) : usual;
}

inline constexpr int chains = 100;

}  // namespace dynid::test
