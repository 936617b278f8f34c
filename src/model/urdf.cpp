// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/urdf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "conversions.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "not_expressed.hpp"
#include "urdf_chain.hpp"

namespace dynid {
namespace {

using detail::UrdfChain;
using detail::UrdfJoint;
using detail::XmlElement;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double unlimited = 1e16;  // what simulators write, and take, for a limit that there is not

const Eigen::Vector3d urdf_gravity(0, 0, -9.81);

/// What is written is read again as the same double.
std::string number(double x) { return exact_number(x); }

// ------------------------------------------------------------------------------------------------- reading

double magnitude_limit(double value) { return value == 0.0 || value >= unlimited ? infinity : value; }

Joint to_joint(const UrdfJoint& from) {
  const urdf::Joint& source = *from.joint;
  Joint joint;
  joint.name = source.name;
  joint.link_name = from.link->name;
  joint.type = source.type == urdf::Joint::PRISMATIC    ? JointType::prismatic
               : source.type == urdf::Joint::CONTINUOUS ? JointType::continuous
                                                        : JointType::revolute;
  joint.origin = from.origin;
  joint.axis = Eigen::Vector3d(source.axis.x, source.axis.y, source.axis.z);
  // A unit vector is kept to the last bit, so that writing and reading does not wander.
  if (std::abs(joint.axis.norm() - 1.0) > 1e-15) joint.axis.normalize();
  if (source.limits) {
    const urdf::JointLimits& limits = *source.limits;
    joint.limits.velocity = magnitude_limit(limits.velocity);
    joint.limits.torque = magnitude_limit(limits.effort);
    if (joint.type != JointType::continuous && (limits.lower != 0.0 || limits.upper != 0.0)) {
      joint.limits.lower = limits.lower <= -unlimited ? -infinity : limits.lower;
      joint.limits.upper = limits.upper >= unlimited ? infinity : limits.upper;
    }
  }
  if (source.dynamics) {
    joint.friction.linear.viscous = source.dynamics->damping;
    joint.friction.linear.coulomb = source.dynamics->friction;
  }
  joint.parameters = detail::own_parameters(*from.link) + from.lumped;
  return joint;
}

Robot to_robot(const UrdfChain& chain, const std::string& name) {
  Robot robot;
  robot.name = chain.robot_name;
  robot.base_link = chain.base;
  robot.tip_link = chain.tip;
  robot.tip = chain.tip_pose;
  robot.gravity = chain.base_pose.linear().transpose() * urdf_gravity;
  for (const UrdfJoint& joint : chain.joints) robot.joints.push_back(to_joint(joint));
  try {
    validate(robot);
  } catch (const Error& error) {
    throw Error(name + ": " + error.what());
  }
  return robot;
}

// ------------------------------------------------------------------------------------------------- writing

std::string triple(const Eigen::Vector3d& v) {
  return number(v[0]) + " " + number(v[1]) + " " + number(v[2]);
}

std::string attribute(const char* key, const std::string& value) {
  return std::string(" ") + key + "=\"" + xml_escaped(value) + "\"";
}

std::string origin_text(const Eigen::Isometry3d& pose) {
  return "<origin" + attribute("xyz", triple(pose.translation())) +
         attribute("rpy", triple(detail::rpy_from_rotation(pose.linear()))) + "/>";
}

/// `<inertial>` about the centre of mass in the axes of the link frame; lines after the first begin with
/// `indent`.
std::string inertial_text(const StandardParameters& p, const std::string& indent) {
  const LinkInertia link = from_standard(p);
  const Eigen::Matrix3d& I = link.inertia;
  return "<inertial>" + indent + "  <origin" + attribute("xyz", triple(link.com)) +
         attribute("rpy", "0 0 0") + "/>" + indent + "  <mass" + attribute("value", number(link.mass)) +
         "/>" + indent + "  <inertia" + attribute("ixx", number(I(0, 0))) +
         attribute("ixy", number(I(0, 1))) + attribute("ixz", number(I(0, 2))) +
         attribute("iyy", number(I(1, 1))) + attribute("iyz", number(I(1, 2))) +
         attribute("izz", number(I(2, 2))) + "/>" + indent + "</inertial>";
}

void list_inertia_not_expressed(const StandardParameters& p, const std::string& link,
                                std::vector<std::string>& list) {
  if (!detail::has_centre_of_mass(p)) {
    list.push_back("link '" + link + "': mass " + number(p[0]) +
                   " kg is too small to carry first moments of " + triple(p.segment<3>(1)) + " kg m");
  }
}

/// What of a joint beyond its frames, position, velocity and torque limits, damping and dry friction there
/// is.
void list_not_expressed(const Joint& joint, std::vector<std::string>& list) {
  const std::string prefix = "joint '" + joint.name + "': ";
  detail::list_friction_not_expressed(joint.friction, prefix, list);
  if (joint.rotor_inertia != 0.0) {
    list.push_back(prefix + "rotor inertia " + number(joint.rotor_inertia) + " kg m^2");
  }
}

void list_limits_not_expressed(const Joint& joint, std::vector<std::string>& list) {
  const JointLimits& limits = joint.limits;
  const std::string prefix = "joint '" + joint.name + "': ";
  if (std::isfinite(limits.acceleration))
    list.push_back(prefix + "acceleration limit " + number(limits.acceleration));
  if (std::isfinite(limits.jerk)) list.push_back(prefix + "jerk limit " + number(limits.jerk));
  if (std::isfinite(limits.torque_rate))
    list.push_back(prefix + "torque rate limit " + number(limits.torque_rate));
  const bool bounded = std::isfinite(limits.lower) || std::isfinite(limits.upper);
  if (bounded && joint.type == JointType::continuous)
    list.push_back(prefix + "position limits of a continuous joint");
  if (limits.lower == 0.0 && limits.upper == 0.0)
    list.push_back(prefix + "position limits that are both zero");
}

void list_gravity_not_expressed(const Eigen::Vector3d& gravity, const Eigen::Vector3d& implied,
                                std::vector<std::string>& list) {
  if ((gravity - implied).norm() > 1e-12)
    list.push_back("gravity " + triple(gravity) + " m/s^2 in the base frame");
}

/// A finite number for each limit.
std::string limit_text(const Joint& joint, bool with_position) {
  const JointLimits& limits = joint.limits;
  const auto finite = [](double value) { return number(std::clamp(value, -unlimited, unlimited)); };
  std::string text = "    <limit";
  if (with_position)
    text += attribute("lower", finite(limits.lower)) + attribute("upper", finite(limits.upper));
  return text + attribute("effort", finite(limits.torque)) + attribute("velocity", finite(limits.velocity)) +
         "/>\n";
}

std::string joint_text(const Joint& joint, const std::string& parent) {
  const JointLimits& limits = joint.limits;
  const bool bounded = std::isfinite(limits.lower) || std::isfinite(limits.upper);
  const bool continuous =
      joint.type == JointType::continuous || (joint.type == JointType::revolute && !bounded);
  const char* type = joint.type == JointType::prismatic ? "prismatic"
                     : continuous                       ? "continuous"
                                                        : "revolute";
  const LinearFriction& friction = joint.friction.linear;
  std::string text = "  <joint" + attribute("name", joint.name) + attribute("type", type) + ">\n";
  text += "    <parent" + attribute("link", parent) + "/>\n";
  text += "    <child" + attribute("link", joint.link_name) + "/>\n";
  text += "    " + origin_text(joint.origin) + "\n";
  text += "    <axis" + attribute("xyz", triple(joint.axis)) + "/>\n";
  if (!continuous || std::isfinite(limits.velocity) || std::isfinite(limits.torque)) {
    text += limit_text(joint, !continuous);
  }
  if (friction.viscous != 0.0 || friction.coulomb != 0.0) {
    text += "    <dynamics" + attribute("damping", number(friction.viscous)) +
            attribute("friction", number(friction.coulomb)) + "/>\n";
  }
  return text + "  </joint>\n";
}

std::string link_text(const std::string& name, const StandardParameters& p) {
  if ((p.array() == 0.0).all()) return "  <link" + attribute("name", name) + "/>\n";
  return "  <link" + attribute("name", name) + ">\n    " + inertial_text(p, "\n    ") + "\n  </link>\n";
}

std::string fixed_joint_text(const std::string& parent, const std::string& child,
                             const Eigen::Isometry3d& pose) {
  return "  <joint" + attribute("name", child + "_joint") + attribute("type", "fixed") + ">\n    <parent" +
         attribute("link", parent) + "/>\n    <child" + attribute("link", child) + "/>\n    " +
         origin_text(pose) + "\n  </joint>\n";
}

// ------------------------------------------------------------------------------------------------ updating

/// Changes to a text, made from its end to its beginning so that positions stay true.
class Edits {
 public:
  void replace(std::size_t begin, std::size_t end, std::string text) {
    edits_.push_back({begin, end, std::move(text)});
  }

  std::string apply(std::string text) {
    std::sort(edits_.begin(), edits_.end(), [](const Edit& a, const Edit& b) { return a.begin > b.begin; });
    for (const Edit& edit : edits_) text.replace(edit.begin, edit.end - edit.begin, edit.text);
    return text;
  }

 private:
  struct Edit {
    std::size_t begin, end;
    std::string text;
  };
  std::vector<Edit> edits_;
};

/// The line break and the white space that stand before `at`.
std::string indentation(const std::string& text, std::size_t at) {
  const auto line = text.rfind('\n', at == 0 ? 0 : at - 1);
  const std::size_t begin = line == std::string::npos ? 0 : line + 1;
  std::size_t end = begin;
  while (end < at && (text[end] == ' ' || text[end] == '\t')) ++end;
  const bool crlf = line != std::string::npos && line > 0 && text[line - 1] == '\r';
  return (crlf ? "\r\n" : "\n") + text.substr(begin, end - begin);
}

const XmlElement* child_of(const std::vector<XmlElement>& elements, const XmlElement& parent,
                           const char* tag) {
  const auto index = static_cast<int>(&parent - elements.data());
  for (const XmlElement& element : elements) {
    if (element.parent == index && element.tag == tag) return &element;
  }
  return nullptr;
}

/// Puts `child`, made for a given indentation, in place of the child of `parent` called `tag`, or first in
/// it.
template <class Make>
void put_child(Edits& edits, const std::string& text, const std::vector<XmlElement>& elements,
               const XmlElement& parent, const char* tag, Make child) {
  if (const XmlElement* old = child_of(elements, parent, tag)) {
    edits.replace(old->begin, old->end, child(indentation(text, old->begin)));
    return;
  }
  const std::string outer = indentation(text, parent.begin);
  const std::string inner = outer + "  ";
  if (!parent.self_closing()) {
    edits.replace(parent.open_end, parent.open_end, inner + child(inner));
    return;
  }
  const std::size_t slash = text.rfind('/', parent.open_end - 1);
  edits.replace(slash, parent.open_end, ">" + inner + child(inner) + outer + "</" + parent.tag + ">");
}

/// urdfdom and expat may read an odd name (white space, an old encoding) differently.
const XmlElement& element_of(const UrdfChain& chain, const char* tag, const std::string& name) {
  const XmlElement* found = detail::find_named(chain.elements, tag, name);
  if (found == nullptr)
    throw Error(std::string(tag) + " '" + name + "' was not found in the text of the URDF");
  return *found;
}

void check_same_joint(const Joint& ours, const Joint& theirs, const std::string& name, int k) {
  const std::string joint = name + ": joint " + std::to_string(k + 1) + " ('" + ours.name + "')";
  if (ours.name != theirs.name) throw Error(joint + ": is '" + theirs.name + "' in the URDF");
  const bool slides = ours.type == JointType::prismatic;
  if (slides != (theirs.type == JointType::prismatic))
    throw Error(joint + ": is of another type in the URDF");
  constexpr double tolerance = 1e-6;
  if (!ours.origin.matrix().isApprox(theirs.origin.matrix(), tolerance) ||
      (ours.axis - theirs.axis).norm() > tolerance) {
    throw Error(joint + ": its frame or its axis is not the URDF's");
  }
}

void update_joint(Edits& edits, const std::string& text, const UrdfChain& chain, const UrdfJoint& target,
                  const Joint& joint) {
  const XmlElement& link_element = element_of(chain, "link", target.link->name);
  const StandardParameters own = joint.parameters - target.lumped;
  if (target.link->inertial || !(own.array() == 0.0).all()) {
    put_child(edits, text, chain.elements, link_element, "inertial",
              [&](const std::string& indent) { return inertial_text(own, indent); });
  }
  const LinearFriction& friction = joint.friction.linear;
  if (!target.joint->dynamics && friction.viscous == 0.0 && friction.coulomb == 0.0) return;
  const XmlElement& joint_element = element_of(chain, "joint", joint.name);
  std::string others;
  if (const XmlElement* old = child_of(chain.elements, joint_element, "dynamics")) {
    for (const auto& [key, value] : old->attributes) {
      if (key != "damping" && key != "friction") others += attribute(key.c_str(), value);
    }
  }
  put_child(edits, text, chain.elements, joint_element, "dynamics", [&](const std::string&) {
    return "<dynamics" + attribute("damping", number(friction.viscous)) +
           attribute("friction", number(friction.coulomb)) + others + "/>";
  });
}

}  // namespace

Robot parse_urdf(const std::string& text, const std::string& name, const std::string& base,
                 const std::string& tip) {
  return to_robot(detail::read_chain(text, name, base, tip), name);
}

Robot read_urdf(const std::string& path, const std::string& base, const std::string& tip) {
  return parse_urdf(read_file(path), path, base, tip);
}

UrdfText to_urdf(const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  UrdfText urdf;
  std::set<std::string> joint_names, link_names{robot.base_link};
  urdf.text = "<?xml version=\"1.0\"?>\n<robot" + attribute("name", robot.name) + ">\n";
  urdf.text += link_text(robot.base_link, StandardParameters::Zero());
  std::string parent = robot.base_link;
  for (const Joint& joint : robot.joints) {
    if (!joint_names.insert(joint.name).second) {
      throw Error("robot '" + robot.name + "': two joints are called '" + joint.name + "'");
    }
    if (!link_names.insert(joint.link_name).second) {
      throw Error("robot '" + robot.name + "': two links are called '" + joint.link_name + "'");
    }
    urdf.text += joint_text(joint, parent) + link_text(joint.link_name, joint.parameters);
    list_limits_not_expressed(joint, urdf.not_expressed);
    list_not_expressed(joint, urdf.not_expressed);
    list_inertia_not_expressed(joint.parameters, joint.link_name, urdf.not_expressed);
    parent = joint.link_name;
  }
  const bool at_last_link = robot.tip.matrix().isIdentity(0.0);
  if (robot.tip_link != parent || !at_last_link) {
    std::string tip = robot.tip_link;
    while (!link_names.insert(tip).second) tip += "_tip";
    urdf.text += fixed_joint_text(parent, tip, robot.tip) + link_text(tip, StandardParameters::Zero());
  }
  urdf.text += "</robot>\n";
  list_gravity_not_expressed(robot.gravity, urdf_gravity, urdf.not_expressed);
  detail::list_effects_not_expressed(robot, ExportFormat::urdf, urdf.not_expressed);
  return urdf;
}

UrdfText update_urdf(const std::string& text, const std::string& name, const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  const auto elements = detail::index_xml(text, name);
  const auto known = [&](const std::string& link) {
    return detail::find_named(elements, "link", link) != nullptr ? link : std::string();
  };
  const UrdfChain chain = detail::read_chain(text, name, known(robot.base_link), known(robot.tip_link));
  const Robot theirs = to_robot(chain, name);
  if (theirs.size() != robot.size()) {
    throw Error(name + ": has " + std::to_string(theirs.size()) + " moving joints between '" + chain.base +
                "' and '" + chain.tip + "', robot '" + robot.name + "' has " + std::to_string(robot.size()));
  }
  UrdfText urdf;
  Edits edits;
  for (int k = 0; k < robot.size(); ++k) {
    const auto index = static_cast<std::size_t>(k);
    const Joint& joint = robot.joints[index];
    check_same_joint(joint, theirs.joints[index], name, k);
    update_joint(edits, text, chain, chain.joints[index], joint);
    list_not_expressed(joint, urdf.not_expressed);
    list_inertia_not_expressed(joint.parameters - chain.joints[index].lumped, chain.joints[index].link->name,
                               urdf.not_expressed);
  }
  list_gravity_not_expressed(robot.gravity, theirs.gravity, urdf.not_expressed);
  detail::list_effects_not_expressed(robot, ExportFormat::urdf, urdf.not_expressed);
  urdf.text = edits.apply(text);
  return urdf;
}

}  // namespace dynid
