// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/robot.hpp"

#include <cmath>

#include "dynid/base/number.hpp"

namespace dynid {
namespace {

constexpr double unit_tolerance =
    1e-9;  // of axes and rotations: far above rounding, far below any real error

std::string label(const Robot& robot, int k) {
  return "joint " + std::to_string(k + 1) + " ('" + robot.joints[static_cast<std::size_t>(k)].name + "')";
}

bool is_rotation(const Eigen::Matrix3d& R) {
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= unit_tolerance &&
         R.determinant() > 0.0;
}

void check_pose(const Eigen::Isometry3d& pose, const std::string& what) {
  if (!pose.matrix().allFinite()) throw Error(what + " is not finite");
  if (!is_rotation(pose.linear())) throw Error(what + " is not a rotation and a translation");
}

void check_limits(const JointLimits& limits, const std::string& joint) {
  if (std::isnan(limits.lower) || std::isnan(limits.upper)) throw Error(joint + ": a position limit is NaN");
  if (limits.lower > limits.upper) {
    throw Error(joint + ": lower limit " + exact_number(limits.lower) + " is above upper limit " +
                exact_number(limits.upper));
  }
  const std::pair<const char*, double> bounds[] = {{"velocity", limits.velocity},
                                                   {"acceleration", limits.acceleration},
                                                   {"jerk", limits.jerk},
                                                   {"torque", limits.torque},
                                                   {"torque_rate", limits.torque_rate}};
  for (const auto& [name, value] : bounds) {
    if (!(value > 0.0))
      throw Error(joint + ": " + name + " limit " + exact_number(value) + " is not positive");
  }
}

void check_joint(const Joint& joint, const std::string& name) {
  check_pose(joint.origin, name + ": origin");
  if (!joint.axis.allFinite() || std::abs(joint.axis.norm() - 1.0) > unit_tolerance) {
    throw Error(name + ": axis is not a unit vector");
  }
  check_limits(joint.limits, name);
  if (!joint.parameters.allFinite())
    throw Error(name + ": a parameter of link '" + joint.link_name + "' is not finite");
  for_each_parameter(joint.friction, [&name](const auto& law, const auto& p) {
    if (!std::isfinite(law.*p.value)) throw Error(name + ": a friction parameter is not finite");
  });
  if (!std::isfinite(joint.rotor_inertia)) throw Error(name + ": rotor inertia is not finite");
}

void check_servo(const Servo& s, const std::string& where) {
  const auto at_least_zero = [&](const char* key, double value) {
    if (!(value >= 0.0) || !std::isfinite(value))
      throw Error(where + key + " must be a number of at least zero");
  };
  const auto positive = [&](const char* key, double value) {
    if (!(value > 0.0)) throw Error(where + key + " must be positive");
  };
  at_least_zero("kp", s.kp);
  at_least_zero("kd", s.kd);
  at_least_zero("damping_ratio", s.damping_ratio);
  at_least_zero("coulomb_position", s.coulomb_position);
  at_least_zero("stribeck_position", s.stribeck_position);
  at_least_zero("stribeck_velocity", s.stribeck_velocity);
  at_least_zero("load_friction", s.load_friction);
  at_least_zero("command_time_constant", s.command_time_constant);
  if (!std::isfinite(s.bias) || !std::isfinite(s.delay)) throw Error(where + "bias and delay must be finite");
  positive("torque_limit", s.torque_limit);
  positive("error_limit", s.error_limit);
  if (s.kp > 0.0) {
    if (s.natural_frequency != 0.0 || s.damping_ratio != 0.0 || s.coulomb_position != 0.0)
      throw Error(where +
                  "takes kp, or the ratios natural_frequency, damping_ratio and coulomb_position, not both");
  } else {
    if (!std::isfinite(s.natural_frequency)) throw Error(where + "natural_frequency is not finite");
    positive("natural_frequency", s.natural_frequency);
  }
}

}  // namespace

Eigen::VectorXd Robot::parameters() const {
  Eigen::VectorXd pi(10 * size());
  for (int k = 0; k < size(); ++k) pi.segment<10>(10 * k) = joints[static_cast<std::size_t>(k)].parameters;
  return pi;
}

void Robot::set_parameters(const Eigen::VectorXd& pi) {
  if (pi.size() != 10 * size()) {
    throw Error("robot '" + name + "': expected " + std::to_string(10 * size()) +
                " standard parameters, found " + std::to_string(pi.size()));
  }
  for (int k = 0; k < size(); ++k) joints[static_cast<std::size_t>(k)].parameters = pi.segment<10>(10 * k);
}

Eigen::Isometry3d pose(const ModifiedDh& dh) {
  const double ca = std::cos(dh.alpha), sa = std::sin(dh.alpha);
  const double ct = std::cos(dh.theta), st = std::sin(dh.theta);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << ct, -st, 0, ca * st, ca * ct, -sa, sa * st, sa * ct, ca;
  T.translation() << dh.a, -sa * dh.d, ca * dh.d;
  return T;
}

Joint make_joint(const std::string& name, JointType type, const ModifiedDh& dh) {
  Joint joint;
  joint.name = name;
  joint.link_name = name + "_link";
  joint.type = type;
  joint.origin = pose(dh);
  joint.dh = dh;
  return joint;
}

std::vector<Inconsistency> inconsistencies(const Robot& robot, double tolerance) {
  std::vector<Inconsistency> broken;
  for (int k = 0; k < robot.size(); ++k) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(k)];
    const StandardParameters& p = joint.parameters;
    if ((p.array() == 0.0).all()) continue;
    const auto report = [&](const char* rule, double margin) {
      broken.push_back({k + 1, joint.link_name, rule, margin});
    };
    const ConsistencyMargins margins = consistency_margins(p);
    if (p[0] == 0.0 && !p.segment<3>(1).isZero(tolerance)) {
      report("eq. (11): a link of no mass has no first moments [kg m]", -p.segment<3>(1).norm());
    } else if (!(margins.mass > -tolerance)) {
      report("eq. (11): the mass must be positive [kg]", margins.mass);
    }
    if (!(margins.triangle >= -tolerance)) {
      report("eq. (16): tr(I)/2 - lambda_max(I) must be positive [kg m^2]", margins.triangle);
    }
  }
  return broken;
}

std::string describe(const Inconsistency& broken) {
  return "link '" + broken.link + "' (joint " + std::to_string(broken.joint) + ") breaks " + broken.rule +
         ": margin " + exact_number(broken.margin);
}

void validate(const Robot& robot) {
  const std::string prefix = "robot '" + robot.name + "': ";
  if (robot.joints.empty()) throw Error(prefix + "has no moving joint");
  if (!robot.gravity.allFinite()) throw Error(prefix + "gravity is not finite");
  check_pose(robot.tip, prefix + "tip");
  for (int k = 0; k < robot.size(); ++k) {
    check_joint(robot.joints[static_cast<std::size_t>(k)], prefix + label(robot, k));
  }
  for (const Joint& joint : robot.joints)
    if (joint.servo) check_servo(*joint.servo, prefix + "joint '" + joint.name + "': servo: ");
  for (const Effect& effect : robot.effects) {
    if (effect.name.empty()) throw Error(prefix + "an effect has no name");
    int last = 0;
    for (const int j : effect.joints) {
      if (j <= last || j > robot.size())
        throw Error(prefix + "effect '" + effect.name + "': joints must be increasing numbers from 1 to " +
                    std::to_string(robot.size()));
      last = j;
    }
    for (const auto& [key, values] : effect.parameters)
      for (const double x : values)
        if (!std::isfinite(x))
          throw Error(prefix + "effect '" + effect.name + "': parameter '" + key + "' is not finite");
  }
}

Robot with_payload(const Robot& robot, const LinkInertia& payload) {
  if (robot.joints.empty()) throw Error("robot '" + robot.name + "': has no moving joint to carry a payload");
  Robot loaded = robot;
  loaded.joints.back().parameters += transformed(to_standard(payload), robot.tip);
  return loaded;
}

}  // namespace dynid
