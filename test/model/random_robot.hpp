// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <random>
#include <string>

#include "dynid/model/robot.hpp"

namespace dynid::test {

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

inline Eigen::Vector3d random_vector(Random& random, double size) {
  return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}

inline Eigen::Vector3d random_direction(Random& random) {
  for (;;) {
    const Eigen::Vector3d v = random_vector(random, 1.0);
    if (v.norm() > 0.1 && v.norm() < 1.0) return v.normalized();
  }
}

/// Any rotation; one in three with a pitch of exactly or nearly +-pi/2, where roll and yaw are ill-defined.
inline Eigen::Matrix3d random_rotation(Random& random) {
  const double pi = 3.14159265358979323846;
  double pitch = uniform(random, -pi / 2, pi / 2);
  const double pick = uniform(random, 0, 1);
  if (pick < 0.33) pitch = (pick < 0.16 ? 1 : -1) * (pi / 2 - (pick < 0.08 || pick > 0.25 ? 0.0 : 1e-9));
  return (Eigen::AngleAxisd(uniform(random, -pi, pi), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(uniform(random, -pi, pi), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

inline Eigen::Isometry3d random_pose(Random& random, double size = 0.5) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = random_rotation(random);
  pose.translation() = random_vector(random, size);
  return pose;
}

/// A body that can exist: the central inertia is that of a box of random sides and directions.
inline LinkInertia random_link(Random& random) {
  LinkInertia link;
  link.mass = uniform(random, 0.2, 8.0);
  link.com = random_vector(random, 0.3);
  const Eigen::Vector3d half(uniform(random, 0.02, 0.4), uniform(random, 0.02, 0.4),
                             uniform(random, 0.02, 0.4));
  const Eigen::Vector3d second = link.mass * half.cwiseAbs2() / 3.0;
  const Eigen::Vector3d moments = Eigen::Vector3d::Constant(second.sum()) - second;
  const Eigen::Matrix3d R = random_rotation(random);
  link.inertia = R * moments.asDiagonal() * R.transpose();
  link.inertia = (0.5 * (link.inertia + link.inertia.transpose())).eval();
  return link;
}

/// A chain of revolute, continuous and prismatic joints, some of modified DH rows and some of any origin and
/// axis.
inline Robot random_robot(Random& random, int n) {
  Robot robot;
  robot.name = "random";
  robot.base_link = "base";
  robot.gravity = random_vector(random, 10.0);
  for (int k = 1; k <= n; ++k) {
    const double pick = uniform(random, 0, 1);
    const JointType type = pick < 0.5   ? JointType::revolute
                           : pick < 0.7 ? JointType::continuous
                                        : JointType::prismatic;
    const std::string name = "joint" + std::to_string(k);
    Joint joint;
    if (uniform(random, 0, 1) < 0.4) {
      joint = make_joint(name, type,
                         {uniform(random, -0.5, 0.5), uniform(random, -3, 3), uniform(random, -0.5, 0.5),
                          uniform(random, -3, 3)});
    } else {
      joint.name = name;
      joint.type = type;
      joint.origin = random_pose(random);
      joint.axis = random_direction(random);
    }
    joint.link_name = "link" + std::to_string(k);
    joint.parameters = to_standard(random_link(random));
    if (type != JointType::continuous) {
      joint.limits.lower = uniform(random, -3, 0);
      joint.limits.upper = uniform(random, 0, 3);
    }
    if (uniform(random, 0, 1) < 0.5) joint.limits.velocity = uniform(random, 1, 3);
    if (uniform(random, 0, 1) < 0.5) joint.limits.torque = uniform(random, 1, 100);
    joint.friction.linear.viscous = uniform(random, -0.1, 1);
    joint.friction.linear.coulomb = uniform(random, 0, 1);
    robot.joints.push_back(joint);
  }
  robot.tip = random_pose(random);
  robot.tip_link = "tip";
  return robot;
}

inline Eigen::VectorXd random_position(Random& random, int n) {
  Eigen::VectorXd q(n);
  for (int k = 0; k < n; ++k) q[k] = uniform(random, -3, 3);
  return q;
}

/// Motion of a joint: Rot(axis, q) or Trans(axis q).
inline Eigen::Isometry3d motion(JointType type, const Eigen::Vector3d& axis, double q) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  if (type == JointType::prismatic) {
    T.translation() = axis * q;
  } else {
    T.linear() = Eigen::AngleAxisd(q, axis).toRotationMatrix();
  }
  return T;
}

/// The poses of the n links and of the tip in the base frame.
inline std::vector<Eigen::Isometry3d> link_poses(const Robot& robot, const Eigen::VectorXd& q) {
  std::vector<Eigen::Isometry3d> poses;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int k = 0; k < robot.size(); ++k) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(k)];
    T = T * joint.origin * motion(joint.type, joint.axis, q[k]);
    poses.push_back(T);
  }
  poses.push_back(T * robot.tip);
  return poses;
}

/// The pseudo-inertia of everything that moves, in the base frame: it holds mass, centre of mass and inertia
/// at once.
inline Eigen::Matrix4d total_pseudo_inertia(const Robot& robot, const Eigen::VectorXd& q) {
  const auto poses = link_poses(robot, q);
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const Eigen::Matrix4d T = poses[k].matrix();
    sum += T * pseudo_inertia(robot.joints[k].parameters) * T.transpose();
  }
  return sum;
}

/// The text of the Error that `call` throws; empty when it throws none.
template <class Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// `text` with the first `from` replaced; the test must say one that is there.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("not in the text: " + from);
  return text.replace(at, from.size(), to);
}

}  // namespace dynid::test
