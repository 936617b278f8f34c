// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/model_warning.hpp"
#include "dynid/base/number.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

namespace dynid {
namespace {

/// [kg/m^3] of a cube as wide as the arm's reach: arms have 5 to 50, in grams a thousand times as much.
constexpr double densest = 1000.0;
constexpr double least_limit = 0.05;  // of gravity's largest torque: no arm is built so, kN m for N m is
constexpr int poses = 200;
constexpr std::size_t least_same = 3;  // joints that agree by chance in a round number

std::string joints_text(const std::vector<int>& joints) {
  std::string text;
  for (std::size_t i = 0; i < joints.size(); ++i)
    text += (i == 0 ? "" : i + 1 == joints.size() ? " and " : ", ") + std::to_string(joints[i]);
  return text;
}

std::string rounded(double x) { return short_number(x, 3); }

/// At most two digits that are not zero.
bool is_round(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", x);
  return std::abs(std::atof(text) - x) <= 1e-9 * std::abs(x);
}

/// Torque of gravity on every joint at q: what lies beyond it, about its axis.
Eigen::VectorXd gravity_torque(const Robot& robot, const Eigen::VectorXd& q) {
  const int n = robot.size();
  std::vector<Eigen::Vector3d> at(n), axis(n), first(n);
  std::vector<double> mass(n);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int j = 0; j < n; ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    pose = pose * joint.origin;
    if (joint.type == JointType::prismatic)
      pose.translate(joint.axis * q[j]);
    else
      pose.rotate(Eigen::AngleAxisd(q[j], joint.axis));
    at[j] = pose.translation();
    axis[j] = pose.linear() * joint.axis;
    mass[j] = joint.parameters[0];
    first[j] = mass[j] * at[j] + pose.linear() * joint.parameters.segment<3>(1);
  }
  Eigen::VectorXd out(n);
  double m = 0.0;
  Eigen::Vector3d h = Eigen::Vector3d::Zero();
  for (int j = n - 1; j >= 0; --j) {
    m += mass[j], h += first[j];
    out[j] = robot.joints[static_cast<std::size_t>(j)].type == JointType::prismatic
                 ? -m * axis[j].dot(robot.gravity)
                 : -axis[j].dot((h - m * at[j]).cross(robot.gravity));
  }
  return out;
}

Eigen::VectorXd largest_gravity_torque(const Robot& robot) {
  std::mt19937_64 random(1);
  const int n = robot.size();
  Eigen::VectorXd q(n), most = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < poses; ++k) {
    for (int j = 0; j < n; ++j) {
      const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
      const double low = std::max(limits.lower, -3.14), high = std::min(limits.upper, 3.14);
      q[j] = low + (high - low) * double(random() >> 11) * 0x1.0p-53;
    }
    most = most.cwiseMax(gravity_torque(robot, q).cwiseAbs());
  }
  return most;
}

}  // namespace

std::vector<ModelWarning> check_model(const Robot& robot) {
  validate(robot);
  std::vector<ModelWarning> list;
  const auto n = robot.joints.size();
  std::vector<int> without;
  double mass = 0.0, reach = 0.0, beyond = 0.0;
  for (std::size_t j = 0; j < n; ++j) {
    const Joint& joint = robot.joints[j];
    const StandardParameters& p = joint.parameters;
    if (p.isZero(0.0)) without.push_back(static_cast<int>(j) + 1);
    mass += std::max(p[0], 0.0);
    if (j > 0) reach += joint.origin.translation().norm();
    if (p[0] > 0.0) beyond = std::max(beyond, p.segment<3>(1).norm() / p[0]);
  }
  reach += beyond;
  if (!without.empty()) {
    std::string names;
    for (const int j : without)
      names += (names.empty() ? "'" : ", '") + robot.joints[static_cast<std::size_t>(j - 1)].link_name + "'";
    list.push_back({"missing_inertial", without, 0.0,
                    "moving link " + names + " (joint " + joints_text(without) +
                        ") has no inertial: it is computed with as weightless"});
  }
  if (reach > 0.0 && mass > densest * reach * reach * reach)
    list.push_back({"mass_unit",
                    {},
                    mass,
                    "the links weigh " + rounded(mass) + " kg over a reach of " + rounded(reach) +
                        " m: masses and inertias look like grams for kilograms"});
  const Eigen::VectorXd gravity = largest_gravity_torque(robot);
  std::vector<int> weak;
  for (std::size_t j = 0; j < n; ++j)
    if (robot.joints[j].limits.torque < least_limit * gravity[static_cast<Eigen::Index>(j)])
      weak.push_back(static_cast<int>(j) + 1);
  if (!weak.empty()) {
    const auto j = static_cast<std::size_t>(weak.front() - 1);
    const double limit = robot.joints[j].limits.torque;
    list.push_back({"torque_limit", weak, limit,
                    "the effort limit of joint " + joints_text(weak) +
                        " is a small part of what gravity alone asks for (" + robot.joints[j].name + ": " +
                        rounded(limit) + " of " + rounded(gravity[weak.front() - 1]) +
                        " N m): kN m for N m?"});
  }
  const double damping = robot.joints.front().friction.linear.viscous;
  const bool same_damping = std::all_of(robot.joints.begin(), robot.joints.end(), [&](const Joint& joint) {
    return joint.friction.linear.viscous == damping;
  });
  if (n >= least_same && same_damping && damping != 0.0 && is_round(damping))
    list.push_back({"placeholder_damping",
                    {},
                    damping,
                    "damping is " + rounded(damping) +
                        " on every joint: a placeholder for a simulator, no measured friction"});
  const StandardParameters& p = robot.joints.front().parameters;
  const double inertia = p.tail<6>().norm();
  const bool same_inertial = std::all_of(robot.joints.begin(), robot.joints.end(), [&](const Joint& joint) {
    return joint.parameters[0] == p[0] && (joint.parameters.segment<3>(1) - p.segment<3>(1)).isZero(0.0) &&
           joint.parameters.tail<6>().norm() == inertia;
  });
  if (n >= least_same && same_inertial && !p.isZero(0.0))
    list.push_back(
        {"placeholder_inertial",
         {},
         p[0],
         "every link has the same inertial (" + rounded(p[0]) + " kg): a placeholder, no model of the arm"});
  return list;
}

}  // namespace dynid
