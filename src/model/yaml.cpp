// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <initializer_list>
#include <optional>
#include <set>
#include <utility>

#include "dynid/base/file.hpp"
#include "dynid/effect/complete.hpp"
#include "text.hpp"

namespace dynid {
namespace {

using detail::number;

constexpr const char* format_name = "dynid-model-1";

constexpr const char* header =
    R"(# A robot's dynamic model. SI units (m, rad, s, kg, N m); joints and links from base to tip.
# dh: modified Denavit-Hartenberg, Rx(alpha) Tx(a) Rz(theta + q) Tz(d). origin: pose of the link frame at q = 0 in its
# parent's, rpy = (roll, pitch, yaw) of Rz(yaw) Ry(pitch) Rx(roll); axis: in the link frame.
# com: centre of mass in the link frame. inertia: tensor about the centre of mass in the axes of the link frame.
# first_moment, inertia_about_origin: mass x com, and the tensor about the frame's origin (where a mass is too small
# for a centre of mass). friction: viscous dq + coulomb sign(dq) + offset
# + phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)), where sign(dq) is tanh(dq / velocity_scale) if
# that is given. gravity: in the base frame. effects: beyond the rigid body and friction, joints from 1.
# servo: kp (u(t - delay) - q - bias) - kd dq drives the joint; without kp only ratios to it are known:
# natural_frequency sqrt(kp / J), damping_ratio, coulomb_position Fc / kp.
)";

/// A node and where it stands, for errors.
class Item {
 public:
  Item(const YAML::Node& node, std::string path, const std::string& file)
      : node_(node), path_(std::move(path)), file_(&file), mark_(node_.Mark()) {}

  [[noreturn]] void fail(const std::string& what) const {
    const std::string line = mark_.is_null() ? "" : ":" + std::to_string(mark_.line + 1);
    throw Error(*file_ + line + ": " + (path_.empty() ? "" : path_ + ": ") + what);
  }

  /// Refuses what is not a map, a key twice, and every key outside `known`.
  void expect_keys(std::initializer_list<const char*> known) const {
    if (!node_.IsMap()) fail(std::string("expected a map, found ") + kind());
    std::set<std::string> seen;
    for (const auto& entry : node_) {
      const Item key(entry.first, path_, *file_);
      if (!entry.first.IsScalar()) key.fail("a key is not a word");
      const std::string& name = entry.first.Scalar();
      bool found = false;
      for (const char* k : known) found = found || name == k;
      if (!found) key.fail("unknown key '" + name + "'");
      if (!seen.insert(name).second) key.fail("key '" + name + "' appears twice");
    }
  }

  bool has(const char* key) const { return static_cast<bool>(node_[key]); }

  Item at(const char* key) const {
    const YAML::Node child = node_[key];
    const std::string child_path = path_.empty() ? key : path_ + "." + key;
    if (!child) Item(node_, child_path, *file_).fail("missing");
    Item item(child, child_path, *file_);
    if (child.IsNull()) item.mark_ = mark_of_key(key);  // nothing stands wherever the next thing does
    return item;
  }

  std::vector<Item> list() const {
    if (!node_.IsSequence()) fail(std::string("expected a list, found ") + kind());
    std::vector<Item> items;
    for (std::size_t k = 0; k < node_.size(); ++k) {
      items.emplace_back(node_[k], path_ + "[" + std::to_string(k + 1) + "]", *file_);
    }
    return items;
  }

  /// Of a map, in the order of the file.
  std::vector<std::pair<std::string, Item>> entries() const {
    if (!node_.IsMap()) fail(std::string("expected a map, found ") + kind());
    std::vector<std::pair<std::string, Item>> items;
    std::set<std::string> seen;
    for (const auto& entry : node_) {
      const std::string key = Item(entry.first, path_, *file_).name();
      if (!seen.insert(key).second) fail("key '" + key + "' appears twice");
      items.emplace_back(key, Item(entry.second, path_ + "." + key, *file_));
    }
    return items;
  }

  double number() const {
    double value = 0.0;
    if (!node_.IsScalar()) fail(std::string("expected a number, found ") + kind());
    if (!detail::parse_number(node_.Scalar(), value)) {
      fail("expected a finite number, found '" + node_.Scalar() + "'");
    }
    return value;
  }

  template <int N>
  Eigen::Matrix<double, N, 1> vector() const {
    if (!node_.IsSequence()) fail("expected " + std::to_string(N) + " numbers, found " + kind());
    if (node_.size() != N) {
      fail("expected " + std::to_string(N) + " numbers, found " + std::to_string(node_.size()));
    }
    Eigen::Matrix<double, N, 1> v;
    const std::vector<Item> items = list();
    for (int k = 0; k < N; ++k) v[k] = items[static_cast<std::size_t>(k)].number();
    return v;
  }

  std::string text() const {
    if (!node_.IsScalar()) fail(std::string("expected a text, found ") + kind());
    return node_.Scalar();
  }

  std::string name() const {
    std::string value = text();
    if (value.empty()) fail("expected a name, found an empty text");
    return value;
  }

  bool boolean() const {
    const std::string value = text();
    if (value != "true" && value != "false") fail("expected true or false, found '" + value + "'");
    return value == "true";
  }

 private:
  YAML::Mark mark_of_key(const char* key) const {
    for (const auto& entry : node_) {
      if (entry.first.Scalar() == key) return entry.first.Mark();
    }
    return mark_;
  }

  const char* kind() const {
    switch (node_.Type()) {
      case YAML::NodeType::Map:
        return "a map";
      case YAML::NodeType::Sequence:
        return "a list";
      case YAML::NodeType::Scalar:
        return "a single value";
      default:
        return "nothing";
    }
  }

  YAML::Node node_;
  std::string path_;
  const std::string* file_;
  YAML::Mark mark_;
};

Eigen::Isometry3d read_pose(const Item& item) {
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

Eigen::Matrix3d read_tensor(const Item& item) {
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

StandardParameters read_inertia(const Item& item) {
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

JointLimits read_limits(const Item& item) {
  item.expect_keys({"lower", "upper", "velocity", "acceleration", "jerk", "torque", "torque_rate"});
  JointLimits limits;
  const auto read = [&](const char* key, double& value) {
    if (item.has(key)) value = item.at(key).number();
  };
  const auto read_positive = [&](const char* key, double& value) {
    read(key, value);
    if (!(value > 0.0)) item.at(key).fail("expected a positive number, found " + number(value));
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

JointFriction read_friction(const Item& item) {
  item.expect_keys({"viscous", "coulomb", "offset", "velocity_scale", "phi1", "phi2", "phi3"});
  JointFriction friction;
  const auto read = [&](const char* key, double& value) {
    if (item.has(key)) value = item.at(key).number();
  };
  read("viscous", friction.linear.viscous);
  read("coulomb", friction.linear.coulomb);
  read("offset", friction.linear.offset);
  read("velocity_scale", friction.linear.velocity_scale);
  if (friction.linear.velocity_scale < 0.0)
    item.at("velocity_scale").fail("expected a number that is not negative");
  if (item.has("phi1") || item.has("phi2") || item.has("phi3")) {
    friction.sigmoid = {item.at("phi1").number(), item.at("phi2").number(), item.at("phi3").number()};
  }
  return friction;
}

constexpr std::pair<JointType, const char*> joint_types[] = {{JointType::revolute, "revolute"},
                                                             {JointType::continuous, "continuous"},
                                                             {JointType::prismatic, "prismatic"}};

JointType read_type(const Item& item) {
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

Servo read_servo(const Item& item) {
  item.expect_keys({"kp", "kd", "natural_frequency", "damping_ratio", "coulomb_position", "delay", "bias",
                    "stribeck_position", "stribeck_velocity", "load_friction", "torque_limit", "error_limit",
                    "command_time_constant"});
  if (!item.has("kp") && !item.has("natural_frequency")) item.fail("missing kp, or natural_frequency");
  Servo servo;
  for (const ServoKey& k : servo_keys)
    if (item.has(k.key)) servo.*k.value = item.at(k.key).number();
  return servo;
}

Joint read_joint(const Item& item) {
  item.expect_keys({"name", "link", "type", "dh", "origin", "axis", "limits", "mass", "com", "inertia",
                    "first_moment", "inertia_about_origin", "friction", "rotor_inertia", "servo"});
  Joint joint;
  joint.name = item.at("name").name();
  joint.link_name = item.at("link").name();
  joint.type = read_type(item.at("type"));
  if (item.has("dh")) {
    if (item.has("origin") || item.has("axis")) item.fail("takes dh, or origin and axis, not both");
    const Item row = item.at("dh");
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
  if (item.has("friction")) joint.friction = read_friction(item.at("friction"));
  if (item.has("rotor_inertia")) joint.rotor_inertia = item.at("rotor_inertia").number();
  if (item.has("servo")) joint.servo = read_servo(item.at("servo"));
  return joint;
}

Coefficient read_coefficient(const Item& item) {
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
Effect read_effect(const Item& item, const Robot& robot) {
  const int joints = robot.size();
  item.expect_keys({"name", "joints", "parameters"});
  Effect effect;
  effect.name = item.at("name").name();
  for (const Item& entry : item.at("joints").list()) {
    const double j = entry.number();
    const double least = effect.joints.empty() ? 1 : effect.joints.back() + 1;
    if (!(j >= least && j <= joints) || j != std::floor(j)) {
      entry.fail("expected the increasing numbers of joints, 1 to " + std::to_string(joints) + ", found " +
                 number(j));
    }
    effect.joints.push_back(static_cast<int>(j));
  }
  for (const auto& [key, value] : item.at("parameters").entries()) {
    std::vector<double>& numbers = effect.parameters[key];
    for (const Item& entry : value.list()) numbers.push_back(entry.number());
  }
  try {
    return checked_effect(effect, robot);
  } catch (const Error& error) {
    item.fail(error.what());
  }
}

ModelFile read_document(const Item& item) {
  item.expect_keys({"format", "name", "base_link", "tip_link", "tip", "gravity", "note",
                    "physically_consistent", "inconsistencies", "joints", "effects", "coefficients"});
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
    for (const Item& rule : item.at("inconsistencies").list()) rule.text();
  }
  std::set<std::string> names;
  for (const Item& joint : item.at("joints").list()) {
    robot.joints.push_back(read_joint(joint));
    if (!names.insert(robot.joints.back().name).second) {
      joint.at("name").fail("another joint is called '" + robot.joints.back().name + "'");
    }
  }
  if (robot.joints.empty()) item.at("joints").fail("has no joint");
  if (item.has("effects")) {
    for (const Item& entry : item.at("effects").list()) {
      robot.effects.push_back(read_effect(entry, robot));
    }
  }
  if (item.has("coefficients")) {
    for (const Item& entry : item.at("coefficients").list()) {
      model.coefficients.push_back(read_coefficient(entry));
    }
  }
  return model;
}

// ------------------------------------------------------------------------------------------------- writing

template <class Vector>
void put(YAML::Emitter& out, const Vector& v) {
  out << YAML::Flow << YAML::BeginSeq;
  for (Eigen::Index k = 0; k < v.size(); ++k) out << number(v[k]);
  out << YAML::EndSeq;
}

void put(YAML::Emitter& out, const char* key, double value) {
  out << YAML::Key << key << YAML::Value << number(value);
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

void put_friction(YAML::Emitter& out, const JointFriction& friction) {
  const LinearFriction& linear = friction.linear;
  const SigmoidFriction& sigmoid = friction.sigmoid;
  const bool has_linear = linear.viscous != 0.0 || linear.coulomb != 0.0 || linear.offset != 0.0;
  const bool has_sigmoid = sigmoid.phi1 != 0.0 || sigmoid.phi2 != 0.0 || sigmoid.phi3 != 0.0;
  if (!has_linear && !has_sigmoid) return;
  out << YAML::Key << "friction" << YAML::Value << YAML::Flow << YAML::BeginMap;
  if (has_linear) {
    put(out, "viscous", linear.viscous);
    put(out, "coulomb", linear.coulomb);
    put(out, "offset", linear.offset);
    if (linear.velocity_scale != 0.0) put(out, "velocity_scale", linear.velocity_scale);
  }
  if (has_sigmoid) {
    put(out, "phi1", sigmoid.phi1);
    put(out, "phi2", sigmoid.phi2);
    put(out, "phi3", sigmoid.phi3);
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
  put_friction(out, joint.friction);
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
  std::vector<YAML::Node> documents;
  try {
    documents = YAML::LoadAll(text);
  } catch (const YAML::ParserException& error) {
    throw Error(name + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
  if (documents.empty() || documents[0].IsNull()) {
    throw Error(name + ": is empty, expected a model (format: " + format_name + ")");
  }
  const Item root(documents[0], "", name);
  if (documents.size() > 1) root.fail("holds more than one document");
  if (!documents[0].IsMap()) root.fail(std::string("expected a model (format: ") + format_name + ")");
  const Item format = root.at("format");
  if (format.text() != format_name) {
    format.fail(std::string("expected ") + format_name + ", found '" + format.text() + "'");
  }
  try {
    ModelFile model = read_document(root);
    try {
      validate(model.robot);
    } catch (const Error& error) {
      throw Error(name + ": " + error.what());
    }
    return model;
  } catch (const YAML::Exception& error) {
    throw Error(name + ": " + error.msg);
  }
}

ModelFile read_model(const std::string& path) { return parse_model(read_file(path), path); }

std::string to_yaml(const ModelFile& model) {
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
  out << YAML::EndMap;
  return std::string(header) + out.c_str() + "\n";
}

void write_model(const std::string& path, const ModelFile& model) { write_file(path, to_yaml(model)); }

}  // namespace dynid
