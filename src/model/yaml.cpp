// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "base/yaml.hpp"
#include "conversions.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/effect/complete.hpp"
#include "dynid/model/uncertainty.hpp"
#include "friction/yaml.hpp"

namespace dynid {
namespace {

using detail::YamlItem;

constexpr const char* format_name = "dynid-model-1";

constexpr const char* header_to_friction =
    R"(# A robot's dynamic model. SI units (m, rad, s, kg, N m); joints and links from base to tip.
# dh: modified Denavit-Hartenberg, Rx(alpha) Tx(a) Rz(theta + q) Tz(d). origin: pose of the link frame at q = 0 in its
# parent's, rpy = (roll, pitch, yaw) of Rz(yaw) Ry(pitch) Rx(roll); axis: in the link frame.
# com: centre of mass in the link frame. inertia: tensor about the centre of mass in the axes of the link frame.
# first_moment, inertia_about_origin: mass x com, and the tensor about the frame's origin (where a mass is too small
# for a centre of mass). friction: )";

constexpr const char* header_from_friction =
    R"(, where sign(dq) is tanh(dq / velocity_scale) if
# that is given. gravity: in the base frame. effects: beyond the rigid body and friction, joints from 1.
# servo: kp (u(t - delay) - q - bias) - kd dq drives the joint; without kp only ratios to it are known:
# natural_frequency sqrt(kp / J), damping_ratio, coulomb_position Fc / kp.
)";

/// What stands before every model; the laws of friction say what they are.
std::string header() {
  std::vector<std::string> formulas;
  std::apply([&formulas](const auto&... law) { (formulas.emplace_back(law.formula), ...); },
             JointFriction().laws());
  return header_to_friction + join(formulas, "\n# + ") + header_from_friction;
}

Eigen::Isometry3d read_pose(const YamlItem& item) {
  item.expect_keys({"xyz", "rpy", "quaternion"});
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (item.has("xyz")) pose.translation() = item.at("xyz").vector<3>();
  if (item.has("rpy") && item.has("quaternion")) item.fail("takes rpy or quaternion, not both");
  if (item.has("rpy")) pose.linear() = detail::rotation_from_rpy(item.at("rpy").vector<3>());
  if (item.has("quaternion")) {
    const Eigen::Vector4d xyzw = item.at("quaternion").vector<4>();
    if (std::abs(xyzw.norm() - 1.0) > 1e-3) item.at("quaternion").fail("is not of unit length");
    pose.linear() = Eigen::Quaterniond(xyzw).normalized().toRotationMatrix();
  }
  return pose;
}

Eigen::Matrix3d read_tensor(const YamlItem& item) {
  item.expect_keys({"xx", "xy", "xz", "yy", "yz", "zz"});
  Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
  J(0, 0) = item.at("xx").number();
  J(0, 1) = item.at("xy").number();
  J(0, 2) = item.at("xz").number();
  J(1, 1) = item.at("yy").number();
  J(1, 2) = item.at("yz").number();
  J(2, 2) = item.at("zz").number();
  return J.selfadjointView<Eigen::Upper>();
}

StandardParameters read_inertia(const YamlItem& item) {
  StandardParameters p = StandardParameters::Zero();
  const bool central = item.has("com") || item.has("inertia");
  const bool about_origin = item.has("first_moment") || item.has("inertia_about_origin");
  if (central && about_origin) {
    item.fail("takes com and inertia, or first_moment and inertia_about_origin, not both");
  }
  if (about_origin) {
    p[0] = item.at("mass").number();
    p.segment<3>(1) = item.at("first_moment").vector<3>();
    set_inertia_tensor(p, read_tensor(item.at("inertia_about_origin")));
  } else if (central || item.has("mass")) {
    LinkInertia link;
    link.mass = item.at("mass").number();
    link.com = item.at("com").vector<3>();
    link.inertia = read_tensor(item.at("inertia"));
    p = to_standard(link);
  }
  return p;
}

JointLimits read_limits(const YamlItem& item) {
  item.expect_keys({"lower", "upper", "velocity", "acceleration", "jerk", "torque", "torque_rate"});
  JointLimits limits;
  const auto read = [&](const char* key, double& value) {
    if (item.has(key)) value = item.at(key).number();
  };
  const auto read_positive = [&](const char* key, double& value) {
    if (item.has(key)) value = item.at(key).positive_number();
  };
  read("lower", limits.lower);
  read("upper", limits.upper);
  if (limits.lower > limits.upper) item.fail("lower is above upper");
  read_positive("velocity", limits.velocity);
  read_positive("acceleration", limits.acceleration);
  read_positive("jerk", limits.jerk);
  read_positive("torque", limits.torque);
  read_positive("torque_rate", limits.torque_rate);
  return limits;
}

constexpr std::pair<JointType, const char*> joint_types[] = {{JointType::revolute, "revolute"},
                                                             {JointType::continuous, "continuous"},
                                                             {JointType::prismatic, "prismatic"}};

JointType read_type(const YamlItem& item) {
  const std::string name = item.text();
  for (const auto& [type, word] : joint_types) {
    if (name == word) return type;
  }
  item.fail("expected revolute, continuous or prismatic, found '" + name + "'");
}

struct ServoKey {
  const char* key;
  double Servo::*value;
};
constexpr ServoKey servo_keys[] = {{"kp", &Servo::kp},
                                   {"kd", &Servo::kd},
                                   {"natural_frequency", &Servo::natural_frequency},
                                   {"damping_ratio", &Servo::damping_ratio},
                                   {"coulomb_position", &Servo::coulomb_position},
                                   {"delay", &Servo::delay},
                                   {"bias", &Servo::bias},
                                   {"stribeck_position", &Servo::stribeck_position},
                                   {"stribeck_velocity", &Servo::stribeck_velocity},
                                   {"load_friction", &Servo::load_friction},
                                   {"torque_limit", &Servo::torque_limit},
                                   {"error_limit", &Servo::error_limit},
                                   {"command_time_constant", &Servo::command_time_constant}};

Servo read_servo(const YamlItem& item) {
  item.expect_keys({"kp", "kd", "natural_frequency", "damping_ratio", "coulomb_position", "delay", "bias",
                    "stribeck_position", "stribeck_velocity", "load_friction", "torque_limit", "error_limit",
                    "command_time_constant"});
  if (!item.has("kp") && !item.has("natural_frequency")) item.fail("missing kp, or natural_frequency");
  Servo servo;
  for (const ServoKey& k : servo_keys)
    if (item.has(k.key)) servo.*k.value = item.at(k.key).number();
  return servo;
}

Joint read_joint(const YamlItem& item) {
  item.expect_keys({"name", "link", "type", "dh", "origin", "axis", "limits", "mass", "com", "inertia",
                    "first_moment", "inertia_about_origin", "friction", "rotor_inertia", "servo"});
  Joint joint;
  joint.name = item.at("name").name();
  joint.link_name = item.at("link").name();
  joint.type = read_type(item.at("type"));
  if (item.has("dh")) {
    if (item.has("origin") || item.has("axis")) item.fail("takes dh, or origin and axis, not both");
    const YamlItem row = item.at("dh");
    row.expect_keys({"a", "alpha", "d", "theta"});
    joint.dh = ModifiedDh{row.at("a").number(), row.at("alpha").number(), row.at("d").number(),
                          row.has("theta") ? row.at("theta").number() : 0.0};
    joint.origin = pose(*joint.dh);
  } else {
    if (!item.has("origin")) item.fail("missing dh, or origin and axis");
    joint.origin = read_pose(item.at("origin"));
    joint.axis = item.at("axis").vector<3>();
    const double norm = joint.axis.norm();
    if (!(norm > 1e-9)) item.at("axis").fail("has no direction");
    // A unit vector is kept to the last bit, so that writing and reading does not wander.
    if (std::abs(norm - 1.0) > 1e-15) joint.axis /= norm;
  }
  if (item.has("limits")) joint.limits = read_limits(item.at("limits"));
  joint.parameters = read_inertia(item);
  if (item.has("friction")) joint.friction = detail::read_friction<JointFriction>(item.at("friction"));
  if (item.has("rotor_inertia")) joint.rotor_inertia = item.at("rotor_inertia").number();
  if (item.has("servo")) joint.servo = read_servo(item.at("servo"));
  return joint;
}

Coefficient read_coefficient(const YamlItem& item) {
  item.expect_keys({"name", "expression", "value", "std_percent", "kept"});
  Coefficient coefficient;
  coefficient.name = item.at("name").name();
  if (item.has("expression")) coefficient.expression = item.at("expression").text();
  coefficient.value = item.at("value").number();
  coefficient.std_percent =
      item.has("std_percent") ? item.at("std_percent").number() : std::numeric_limits<double>::infinity();
  if (item.has("kept")) coefficient.kept = item.at("kept").boolean();
  return coefficient;
}

/// The robot's joints are those of the file, read before.
Effect read_effect(const YamlItem& item, const Robot& robot) {
  const int joints = robot.size();
  item.expect_keys({"name", "joints", "parameters"});
  Effect effect;
  effect.name = item.at("name").name();
  for (const YamlItem& entry : item.at("joints").list()) {
    const double j = entry.number();
    const double least = effect.joints.empty() ? 1 : effect.joints.back() + 1;
    if (!(j >= least && j <= joints) || j != std::floor(j)) {
      entry.fail("expected the increasing numbers of joints, 1 to " + std::to_string(joints) + ", found " +
                 exact_number(j));
    }
    effect.joints.push_back(static_cast<int>(j));
  }
  for (const auto& [key, value] : item.at("parameters").entries()) {
    std::vector<double>& numbers = effect.parameters[key];
    for (const YamlItem& entry : value.list()) numbers.push_back(entry.number());
  }
  try {
    return checked_effect(effect, robot);
  } catch (const Error& error) {
    item.fail(error.what());
  }
}

struct UncertaintyKey {
  const char* key;
  double JointUncertainty::*value;
};
constexpr UncertaintyKey uncertainty_keys[] = {
    {"constant", &JointUncertainty::constant},         {"speed", &JointUncertainty::speed},
    {"stiction", &JointUncertainty::stiction},         {"load", &JointUncertainty::load},
    {"acceleration", &JointUncertainty::acceleration}, {"stiction_speed", &JointUncertainty::stiction_speed},
    {"sticking", &JointUncertainty::sticking},         {"extent", &JointUncertainty::extent}};

Uncertainty uncertainty_in(const YamlItem& item, int joints) {
  item.expect_keys({"seconds", "window", "motion", "tail", "joints", "correlation"});
  Uncertainty uncertainty;
  if (item.has("seconds")) uncertainty.seconds = item.at("seconds").number();
  uncertainty.window = item.at("window").positive_number();
  const YamlItem motion = item.at("motion"), tail = item.at("tail");
  motion.expect_keys({"bandwidth", "period", "position_noise"});
  uncertainty.motion_bandwidth = motion.at("bandwidth").positive_number();
  uncertainty.period = motion.at("period").number();
  uncertainty.position_noise = motion.at("position_noise").positive_number();
  tail.expect_keys({"level", "scale", "per_hour", "count"});
  uncertainty.tail = {tail.at("level").positive_number(), tail.at("scale").positive_number(),
                      tail.at("per_hour").positive_number(),
                      tail.has("count") ? tail.at("count").number() : 0.0};
  for (const YamlItem& entry : item.at("joints").list()) {
    entry.expect_keys({"constant", "speed", "stiction", "load", "acceleration", "stiction_speed", "sticking",
                       "extent", "contact_point"});
    JointUncertainty joint;
    for (const UncertaintyKey& k : uncertainty_keys)
      if (entry.has(k.key)) joint.*k.value = entry.at(k.key).number();
    if (entry.has("contact_point")) joint.contact_point = entry.at("contact_point").vector<3>();
    uncertainty.joints.push_back(joint);
  }
  uncertainty.correlation = Eigen::MatrixXd::Identity(joints, joints);
  const std::vector<YamlItem> rows = item.at("correlation").list();
  if (static_cast<int>(rows.size()) != joints) item.at("correlation").fail("one row for each joint needed");
  for (int r = 0; r < joints; ++r) {
    const std::vector<YamlItem> row = rows[static_cast<std::size_t>(r)].list();
    if (static_cast<int>(row.size()) != r + 1)
      rows[static_cast<std::size_t>(r)].fail("a row of the lower triangle, with its diagonal, needed");
    for (int c = 0; c <= r; ++c)
      uncertainty.correlation(r, c) = uncertainty.correlation(c, r) =
          row[static_cast<std::size_t>(c)].number();
  }
  return item.located([&] {
    validate(uncertainty, joints);
    return uncertainty;
  });
}

ModelFile read_document(const YamlItem& item) {
  item.expect_keys({"format", "name", "base_link", "tip_link", "tip", "gravity", "note",
                    "physically_consistent", "inconsistencies", "joints", "effects", "coefficients",
                    "uncertainty"});
  ModelFile model;
  Robot& robot = model.robot;
  robot.name = item.at("name").name();
  robot.base_link = item.at("base_link").name();
  robot.tip_link = item.at("tip_link").name();
  if (item.has("tip")) robot.tip = read_pose(item.at("tip"));
  robot.gravity = item.at("gravity").vector<3>();
  if (item.has("note")) model.note = item.at("note").text();
  if (item.has("physically_consistent")) item.at("physically_consistent").boolean();
  if (item.has("inconsistencies")) {
    for (const YamlItem& rule : item.at("inconsistencies").list()) rule.text();
  }
  std::set<std::string> names;
  for (const YamlItem& joint : item.at("joints").list()) {
    robot.joints.push_back(read_joint(joint));
    if (!names.insert(robot.joints.back().name).second) {
      joint.at("name").fail("another joint is called '" + robot.joints.back().name + "'");
    }
  }
  if (robot.joints.empty()) item.at("joints").fail("has no joint");
  if (item.has("effects")) {
    for (const YamlItem& entry : item.at("effects").list()) {
      robot.effects.push_back(read_effect(entry, robot));
    }
  }
  if (item.has("coefficients")) {
    for (const YamlItem& entry : item.at("coefficients").list()) {
      model.coefficients.push_back(read_coefficient(entry));
    }
  }
  if (item.has("uncertainty")) uncertainty_in(item.at("uncertainty"), robot.size());
  return model;
}

// ------------------------------------------------------------------------------------------------- writing

template <class Vector>
void put(YAML::Emitter& out, const Vector& v) {
  out << YAML::Flow << YAML::BeginSeq;
  for (Eigen::Index k = 0; k < v.size(); ++k) out << exact_number(v[k]);
  out << YAML::EndSeq;
}

void put(YAML::Emitter& out, const char* key, double value) {
  out << YAML::Key << key << YAML::Value << exact_number(value);
}

void put_tensor(YAML::Emitter& out, const Eigen::Matrix3d& J) {
  out << YAML::Flow << YAML::BeginMap;
  put(out, "xx", J(0, 0));
  put(out, "xy", J(0, 1));
  put(out, "xz", J(0, 2));
  put(out, "yy", J(1, 1));
  put(out, "yz", J(1, 2));
  put(out, "zz", J(2, 2));
  out << YAML::EndMap;
}

void put_pose(YAML::Emitter& out, const Eigen::Isometry3d& pose) {
  out << YAML::Flow << YAML::BeginMap << YAML::Key << "xyz" << YAML::Value;
  put(out, Eigen::Vector3d(pose.translation()));
  out << YAML::Key << "rpy" << YAML::Value;
  put(out, detail::rpy_from_rotation(pose.linear()));
  out << YAML::EndMap;
}

void put_inertia(YAML::Emitter& out, const StandardParameters& p) {
  if ((p.array() == 0.0).all()) return;
  put(out, "mass", p[0]);
  if (detail::has_centre_of_mass(p)) {
    const LinkInertia link = from_standard(p);
    out << YAML::Key << "com" << YAML::Value;
    put(out, link.com);
    out << YAML::Key << "inertia" << YAML::Value;
    put_tensor(out, link.inertia);
  } else {
    out << YAML::Key << "first_moment" << YAML::Value;
    put(out, Eigen::Vector3d(p.segment<3>(1)));
    out << YAML::Key << "inertia_about_origin" << YAML::Value;
    put_tensor(out, inertia_tensor(p));
  }
}

void put_limits(YAML::Emitter& out, const JointLimits& limits) {
  const std::pair<const char*, double> entries[] = {{"lower", limits.lower},
                                                    {"upper", limits.upper},
                                                    {"velocity", limits.velocity},
                                                    {"acceleration", limits.acceleration},
                                                    {"jerk", limits.jerk},
                                                    {"torque", limits.torque},
                                                    {"torque_rate", limits.torque_rate}};
  bool any = false;
  for (const auto& entry : entries) any = any || std::isfinite(entry.second);
  if (!any) return;
  out << YAML::Key << "limits" << YAML::Value << YAML::Flow << YAML::BeginMap;
  for (const auto& [key, value] : entries) {
    if (std::isfinite(value)) put(out, key, value);
  }
  out << YAML::EndMap;
}

/// What differs from the default: a limit that is not there, a term that was not found, is not written.
void put_servo(YAML::Emitter& out, const Servo& servo) {
  const Servo none;
  out << YAML::Key << "servo" << YAML::Value << YAML::BeginMap;
  for (const ServoKey& k : servo_keys)
    if (servo.*k.value != none.*k.value) put(out, k.key, servo.*k.value);
  out << YAML::EndMap;
}

void put_joint(YAML::Emitter& out, const Joint& joint) {
  const char* type = "";
  for (const auto& [value, word] : joint_types) {
    if (joint.type == value) type = word;
  }
  out << YAML::BeginMap;
  out << YAML::Key << "name" << YAML::Value << joint.name;
  out << YAML::Key << "link" << YAML::Value << joint.link_name;
  out << YAML::Key << "type" << YAML::Value << type;
  // The row is written where it still says what origin and axis say.
  if (joint.dh && pose(*joint.dh).matrix() == joint.origin.matrix() &&
      joint.axis == Eigen::Vector3d::UnitZ()) {
    out << YAML::Key << "dh" << YAML::Value << YAML::Flow << YAML::BeginMap;
    put(out, "a", joint.dh->a);
    put(out, "alpha", joint.dh->alpha);
    put(out, "d", joint.dh->d);
    put(out, "theta", joint.dh->theta);
    out << YAML::EndMap;
  } else {
    out << YAML::Key << "origin" << YAML::Value;
    put_pose(out, joint.origin);
    out << YAML::Key << "axis" << YAML::Value;
    put(out, joint.axis);
  }
  put_limits(out, joint.limits);
  put_inertia(out, joint.parameters);
  detail::put_friction(out, joint.friction);
  if (joint.rotor_inertia != 0.0) put(out, "rotor_inertia", joint.rotor_inertia);
  if (joint.servo) put_servo(out, *joint.servo);
  out << YAML::EndMap;
}

void put_effect(YAML::Emitter& out, const Effect& effect) {
  out << YAML::BeginMap << YAML::Key << "name" << YAML::Value << effect.name;
  out << YAML::Key << "joints" << YAML::Value << YAML::Flow << effect.joints;
  out << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap;
  for (const auto& [key, values] : effect.parameters) {
    out << YAML::Key << key << YAML::Value;
    put(out, Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
  }
  out << YAML::EndMap << YAML::EndMap;
}

void put_coefficient(YAML::Emitter& out, const Coefficient& coefficient) {
  if (!std::isfinite(coefficient.value)) throw Error("coefficient '" + coefficient.name + "' is not finite");
  out << YAML::Flow << YAML::BeginMap;
  out << YAML::Key << "name" << YAML::Value << coefficient.name;
  out << YAML::Key << "expression" << YAML::Value << YAML::DoubleQuoted << coefficient.expression;
  put(out, "value", coefficient.value);
  if (std::isfinite(coefficient.std_percent)) put(out, "std_percent", coefficient.std_percent);
  out << YAML::Key << "kept" << YAML::Value << (coefficient.kept ? "true" : "false");
  out << YAML::EndMap;
}

void put_uncertainty(YAML::Emitter& out, const Uncertainty& uncertainty) {
  out << YAML::Key << "uncertainty" << YAML::Value << YAML::BeginMap;
  put(out, "seconds", uncertainty.seconds);
  put(out, "window", uncertainty.window);
  out << YAML::Key << "motion" << YAML::Value << YAML::Flow << YAML::BeginMap;
  put(out, "bandwidth", uncertainty.motion_bandwidth);
  put(out, "period", uncertainty.period);
  put(out, "position_noise", uncertainty.position_noise);
  out << YAML::EndMap << YAML::Key << "tail" << YAML::Value << YAML::Flow << YAML::BeginMap;
  put(out, "level", uncertainty.tail.level);
  put(out, "scale", uncertainty.tail.scale);
  put(out, "per_hour", uncertainty.tail.per_hour);
  if (uncertainty.tail.count > 0.0) put(out, "count", uncertainty.tail.count);
  out << YAML::EndMap;
  out << YAML::Key << "joints" << YAML::Value << YAML::BeginSeq;
  for (const JointUncertainty& joint : uncertainty.joints) {
    out << YAML::Flow << YAML::BeginMap;
    for (const UncertaintyKey& k : uncertainty_keys) put(out, k.key, joint.*k.value);
    out << YAML::Key << "contact_point" << YAML::Value;
    put(out, joint.contact_point);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::Key << "correlation" << YAML::Value << YAML::BeginSeq;
  for (Eigen::Index r = 0; r < uncertainty.correlation.rows(); ++r)
    put(out, uncertainty.correlation.row(r).head(r + 1));
  out << YAML::EndSeq << YAML::EndMap;
}

void check_names(const Robot& robot) {
  std::set<std::string> names;
  for (const Joint& joint : robot.joints) {
    if (joint.name.empty() || joint.link_name.empty()) {
      throw Error("robot '" + robot.name + "': a joint or a link has no name");
    }
    if (!names.insert(joint.name).second) {
      throw Error("robot '" + robot.name + "': two joints are called '" + joint.name + "'");
    }
  }
  if (robot.name.empty() || robot.base_link.empty() || robot.tip_link.empty()) {
    throw Error("a robot, its base link or its tip link has no name");
  }
}

}  // namespace

ModelFile parse_model(const std::string& text, const std::string& name) {
  const YamlItem root = YamlItem::document(text, name, format_name, "a model");
  ModelFile model = read_document(root);
  try {
    validate(model.robot);
  } catch (const Error& error) {
    throw Error(name + ": " + error.what());
  }
  return model;
}

ModelFile read_model(const std::string& path) { return parse_model(read_file(path), path); }

std::string to_yaml(const ModelFile& model) { return to_yaml(model, std::nullopt); }

std::string to_yaml(const ModelFile& model, const std::optional<Uncertainty>& uncertainty) {
  const Robot& robot = model.robot;
  validate(robot);
  check_names(robot);
  YAML::Emitter out;
  out << YAML::BeginMap;
  out << YAML::Key << "format" << YAML::Value << format_name;
  out << YAML::Key << "name" << YAML::Value << robot.name;
  if (!model.note.empty()) out << YAML::Key << "note" << YAML::Value << YAML::DoubleQuoted << model.note;
  out << YAML::Key << "base_link" << YAML::Value << robot.base_link;
  out << YAML::Key << "tip_link" << YAML::Value << robot.tip_link;
  out << YAML::Key << "tip" << YAML::Value;
  put_pose(out, robot.tip);
  out << YAML::Key << "gravity" << YAML::Value;
  put(out, robot.gravity);
  const std::vector<Inconsistency> broken = inconsistencies(robot);
  out << YAML::Key << "physically_consistent" << YAML::Value << (broken.empty() ? "true" : "false");
  if (!broken.empty()) {
    out << YAML::Key << "inconsistencies" << YAML::Value << YAML::BeginSeq;
    for (const Inconsistency& rule : broken) out << YAML::DoubleQuoted << describe(rule);
    out << YAML::EndSeq;
  }
  out << YAML::Key << "joints" << YAML::Value << YAML::BeginSeq;
  for (const Joint& joint : robot.joints) put_joint(out, joint);
  out << YAML::EndSeq;
  if (!robot.effects.empty()) {
    out << YAML::Key << "effects" << YAML::Value << YAML::BeginSeq;
    for (const Effect& effect : robot.effects) put_effect(out, checked_effect(effect, robot));
    out << YAML::EndSeq;
  }
  if (!model.coefficients.empty()) {
    out << YAML::Key << "coefficients" << YAML::Value << YAML::BeginSeq;
    for (const Coefficient& coefficient : model.coefficients) put_coefficient(out, coefficient);
    out << YAML::EndSeq;
  }
  if (uncertainty) {
    validate(*uncertainty, robot.size());
    put_uncertainty(out, *uncertainty);
  }
  out << YAML::EndMap;
  return header() + out.c_str() + "\n";
}

void write_model(const std::string& path, const ModelFile& model) { write_file(path, to_yaml(model)); }

void write_model(const std::string& path, const ModelFile& model,
                 const std::optional<Uncertainty>& uncertainty) {
  write_file(path, to_yaml(model, uncertainty));
}

std::optional<Uncertainty> parse_uncertainty(const std::string& text, const std::string& name) {
  const YamlItem root = YamlItem::document(text, name, format_name, "a model");
  if (!root.has("uncertainty")) return std::nullopt;
  return uncertainty_in(root.at("uncertainty"), static_cast<int>(root.at("joints").list().size()));
}

std::optional<Uncertainty> read_uncertainty(const std::string& path) {
  const std::size_t dot = path.find_last_of('.');
  const std::string ending = dot == std::string::npos ? "" : path.substr(dot);
  if (ending != ".yaml" && ending != ".yml") return std::nullopt;
  return parse_uncertainty(read_file(path), path);
}

}  // namespace dynid
