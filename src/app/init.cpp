// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/init.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "dynid/app/option_error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

bool is_word(const std::string& name) {
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !name.empty() && std::all_of(name.begin(), name.end(), fits);
}

/// Column `key` of the table; zeros where it may be left out and is.
Eigen::VectorXd column(const Table& dh, const std::string& key, bool needed) {
  const int at = dh.find(key);
  if (at >= 0) return dh.values.col(at);
  if (needed)
    throw Error(dh.source + ": no column '" + key +
                "': a, alpha, d and, where it is not 0, theta are expected");
  return Eigen::VectorXd::Zero(dh.values.rows());
}

/// The rows as modified Denavit-Hartenberg; what the last standard row leaves goes into `tip`.
std::vector<ModifiedDh> modified_rows(const InitJob& job, Eigen::Isometry3d& tip) {
  const Table& dh = job.dh;
  for (const std::string& name : dh.names)
    if (name != "a" && name != "alpha" && name != "d" && name != "theta")
      throw Error(dh.source + ": column '" + name + "' is none of a, alpha, d and theta");
  const double unit = job.degrees ? M_PI / 180.0 : 1.0;
  const Eigen::VectorXd a = column(dh, "a", true), alpha = unit * column(dh, "alpha", true),
                        d = column(dh, "d", true), theta = unit * column(dh, "theta", false);
  std::vector<ModifiedDh> rows;
  ModifiedDh next;  // a and alpha of a standard row belong before the joint that follows it
  for (Eigen::Index i = 0; i < dh.values.rows(); ++i) {
    if (job.convention == DhConvention::modified) next.a = a[i], next.alpha = alpha[i];
    next.d = d[i], next.theta = theta[i];
    rows.push_back(next);
    next.a = a[i], next.alpha = alpha[i];
  }
  if (job.convention == DhConvention::standard) {
    next.d = next.theta = 0.0;
    tip = pose(next);
  }
  return rows;
}

JointType type_of(char letter) {
  return letter == 'P' ? JointType::prismatic : letter == 'C' ? JointType::continuous : JointType::revolute;
}
const char* word_of(JointType type) {
  return type == JointType::prismatic    ? "prismatic"
         : type == JointType::continuous ? "continuous"
                                         : "revolute";
}

Robot robot_of(const InitJob& job) {
  Robot robot;
  robot.name = job.name;
  robot.gravity = job.gravity;
  const std::vector<ModifiedDh> rows = modified_rows(job, robot.tip);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string number = std::to_string(i + 1);
    robot.joints.push_back(make_joint(job.joint_names.empty() ? "joint" + number : job.joint_names[i],
                                      type_of(job.types.empty() ? 'R' : job.types[i]), rows[i]));
    robot.joints.back().link_name = "link" + number;
  }
  return robot;
}

std::string list(const Eigen::Vector3d& x) {
  return "[" + exact_number(x[0]) + ", " + exact_number(x[1]) + ", " + exact_number(x[2]) + "]";
}

/// Roll of a turn about x: all that a standard row leaves behind its joint.
double roll(const Eigen::Isometry3d& tip) { return std::atan2(tip.linear()(2, 1), tip.linear()(1, 1)); }

void write_joint(std::ostream& out, const Joint& joint, bool explain) {
  const bool slides = joint.type == JointType::prismatic;
  const std::string force = slides ? "N" : "N m", speed = slides ? "m/s" : "rad/s";
  const auto note = [&](const std::string& text) { return explain ? "  # " + text : std::string(); };
  out << "  - name: " << joint.name
      << note("as in the joint states and in the columns of a log, where these have names")
      << "\n    link: " << joint.link_name << "\n    type: " << word_of(joint.type)
      << note("revolute (turns between limits), continuous (turns without) or prismatic (slides)")
      << "\n    dh: {a: " << exact_number(joint.dh->a) << ", alpha: " << exact_number(joint.dh->alpha)
      << ", d: " << exact_number(joint.dh->d) << ", theta: " << exact_number(joint.dh->theta) << "}"
      << note("Rx(alpha) Tx(a) Rz(theta + q) Tz(d)") << "\n";
  // Examples, for whoever takes the # away.
  const bool continuous = joint.type == JointType::continuous;
  out << "    #: limits: {"
      << (continuous ? ""
          : slides   ? "lower: 0, upper: 0.5, "
                     : "lower: -2.8, upper: 2.8, ")
      << (slides ? "velocity: 0.5, acceleration: 5, torque: 500}"
                 : "velocity: 2, acceleration: 10, torque: 80}")
      << note((slides ? "[m], [" : "[rad], [") + speed + "], [" + speed + "^2], [" + force +
              "]: for dynid excite and simulate")
      << "\n    #: mass: 2.0" << note("[kg]: this and the next two are not needed by dynid identify")
      << "\n    #: com: [0, 0, 0.1]" << note("centre of mass in the link frame [m]")
      << "\n    #: inertia: {xx: 0.02, xy: 0, xz: 0, yy: 0.02, yz: 0, zz: 0.005}"
      << note("about com, in the axes of the link frame [kg m^2]")
      << "\n    #: friction: {viscous: 1.0, coulomb: 0.5, offset: 0, velocity_scale: 0.005}"
      << note("[" + force + " per " + speed + "], [" + force + "], [" + force + "], [" + speed + "]")
      << "\n    #: rotor_inertia: 0.1"
      << note(slides ? "of the motor, as a mass at the joint [kg]"
                     : "of the motor, times the gear ratio squared [kg m^2]")
      << "\n    #: servo: {kp: 200, kd: 5, delay: 0.02, torque_limit: 80}"
      << note("of a position servo whose torque is not measured: dynid identify --servo") << "\n";
}

std::string text_of(const InitJob& job, const Robot& robot) {
  std::ostringstream out;
  out << "# " << robot.name << ": a model to go on from, made of the Denavit-Hartenberg table "
      << job.dh.source
      << (job.convention == DhConvention::standard ? " (standard rows, written here as modified ones)" : "")
      << ".\n"
      << "# Units: m, rad, s, kg, N m. Joints and links from base to tip. Lines that begin with #: are "
         "examples of what\n"
      << "# the table does not say: take the #: away and put your own figures; what is left out is not "
         "known.\n"
      << "# Then: dynid info --robot FILE                            does it read? what can be identified?\n"
      << "#       dynid identify --robot FILE --log LOG --out MODEL  dynamics from motion: needs the "
         "kinematics alone\n"
      << "format: dynid-model-1\n"
      << "name: " << robot.name << "\n"
      << "base_link: base\n"
      << "tip_link: tip\n"
      << "# Pose of the tip (flange, tool) in the last link's frame: xyz [m], rpy = roll, pitch, yaw [rad] "
         "of\n"
      << "# Rz(yaw) Ry(pitch) Rx(roll).\n"
      << "tip: {xyz: " << list(robot.tip.translation()) << ", rpy: [" << exact_number(roll(robot.tip))
      << ", 0, 0]}\n"
      << "# [m/s^2], in the base frame. An arm on a wall whose base's x axis points down has [9.81, 0, 0].\n"
      << "gravity: " << list(robot.gravity) << "\n"
      << "joints:\n";
  for (std::size_t i = 0; i < robot.joints.size(); ++i) write_joint(out, robot.joints[i], i == 0);
  return out.str();
}

}  // namespace

void check_options(const InitJob& job) {
  const auto rows = static_cast<std::size_t>(job.dh.values.rows());
  const std::string joints = std::to_string(rows) + (rows == 1 ? " joint" : " joints");
  if (!job.types.empty()) {
    if (job.types.size() != rows || job.types.find_first_not_of("RPC") != std::string::npos)
      throw OptionError("types", "'" + job.types +
                                     "': a letter of R (turns), P (slides) and C (turns without limits) "
                                     "is expected for each of the table's " +
                                     joints);
  }
  if (!is_word(job.name))
    throw OptionError("name", "'" + job.name + "': letters, digits, _, - and . are expected");
  if (!job.joint_names.empty() && job.joint_names.size() != rows)
    throw OptionError("names", std::to_string(job.joint_names.size()) + " for the table's " + joints);
  std::set<std::string> seen;
  for (const std::string& name : job.joint_names) {
    if (!is_word(name))
      throw OptionError("names", "'" + name + "': letters, digits, _, - and . are expected");
    if (!seen.insert(name).second) throw OptionError("names", "two joints are called '" + name + "'");
  }
  if (!job.gravity.allFinite()) throw OptionError("gravity", "three finite numbers are expected");
}

InitReport run(const InitJob& job, const Context& context) {
  check_options(job);
  context.check();
  const std::string text = text_of(job, robot_of(job));
  return {parse_model(text, job.name).robot, text};  // read back: what is written is a model
}

}  // namespace dynid
