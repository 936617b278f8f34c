// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <set>

#include "conversions.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/export.hpp"
#include "export_common.hpp"
#include "not_expressed.hpp"

namespace dynid {
namespace {

using namespace detail::exporting;

std::string element(const char* tag, const std::string& value) {
  return std::string("<") + tag + ">" + xml_escaped(value) + "</" + tag + ">";
}

std::string sdf_pose(const Eigen::Isometry3d& pose, const std::string& relative_to) {
  return "<pose" + (relative_to.empty() ? "" : attribute("relative_to", relative_to)) + ">" +
         triple(pose.translation()) + " " + triple(detail::rpy_from_rotation(pose.linear())) + "</pose>";
}

std::string sdf_inertial(const LinkInertia& body) {
  const PrincipalInertia principal = principal_inertia(body);
  std::string text = "      <inertial>\n        " + sdf_pose(principal.frame, "") + "\n        " +
                     element("mass", number(body.mass)) + "\n        <inertia>";
  text += element("ixx", number(principal.moments[0])) + element("iyy", number(principal.moments[1])) +
          element("izz", number(principal.moments[2]));
  for (const char* product : {"ixy", "ixz", "iyz"}) text += element(product, "0");
  return text + "</inertia>\n      </inertial>\n";
}

std::string sdf_joint(const Joint& joint, const std::string& name, const std::string& parent) {
  const JointLimits& limits = joint.limits;
  const LinearFriction& friction = joint.friction.linear;
  const char* type = joint.type == JointType::prismatic                              ? "prismatic"
                     : joint.type == JointType::continuous && !bounded(joint.limits) ? "continuous"
                                                                                     : "revolute";
  std::string text = "    <joint" + attribute("name", name) + attribute("type", type) + ">\n      " +
                     element("parent", parent) + "\n      " + element("child", joint.link_name) +
                     "\n      <axis>\n        " + element("xyz", triple(joint.axis)) + "\n        <limit>" +
                     element("lower", position_limit(limits.lower)) +
                     element("upper", position_limit(limits.upper));
  if (std::isfinite(limits.torque)) text += element("effort", number(limits.torque));
  if (std::isfinite(limits.velocity)) text += element("velocity", number(limits.velocity));
  text += "</limit>\n";
  if (friction.viscous != 0.0 || friction.coulomb != 0.0) {
    text += "        <dynamics>" + element("damping", number(friction.viscous)) +
            element("friction", number(friction.coulomb)) + "</dynamics>\n";
  }
  return text + "      </axis>\n    </joint>\n";
}

/// The first of name, name<suffix>, name<suffix><suffix>... that is not among `names`, which it joins.
std::string free_name(std::string name, const char* suffix, std::set<std::string>& names) {
  while (!names.insert(name).second) name += suffix;
  return name;
}

}  // namespace

ExportText to_sdf(const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  check_names(robot);
  ExportText out;
  std::string& text = out.text;
  std::set<std::string> names{"world", robot.base_link};
  for (const Joint& joint : robot.joints) names.insert(joint.link_name);
  std::set<std::string> taken = names;  // by links or by joints
  for (const Joint& joint : robot.joints) taken.insert(joint.name);
  text = "<?xml version=\"1.0\"?>\n<sdf version=\"1.7\">\n  <model" + attribute("name", robot.name) + ">\n";
  if (robot.base_link != "world") {
    const std::string fixed = free_name(robot.base_link + "_to_world", "_joint", taken);
    names.insert(fixed);
    text += "    <link" + attribute("name", robot.base_link) + "/>\n    <joint" + attribute("name", fixed) +
            attribute("type", "fixed") + ">\n      <parent>world</parent>\n      " +
            element("child", robot.base_link) + "\n    </joint>\n";
  }
  std::string parent = robot.base_link;
  for (const Joint& joint : robot.joints) {
    const std::string prefix = "joint '" + joint.name + "': ";
    const LinkInertia body = from_standard(joint.parameters);
    const std::string name = free_name(joint.name, "_joint", names);
    text += "    <link" + attribute("name", joint.link_name) + ">\n      " +
            sdf_pose(joint.origin, parent == "world" ? "" : parent) + "\n" + sdf_inertial(body) +
            "    </link>\n" + sdf_joint(joint, name, parent);
    if (name != joint.name)
      out.not_expressed.push_back(prefix + "its name, which is taken: it is '" + name + "' there");
    if (joint.rotor_inertia != 0.0)
      out.not_expressed.push_back(prefix + "rotor inertia " + number(joint.rotor_inertia) + " kg m^2");
    list_joint_not_expressed(joint, out.not_expressed);
    list_first_moments_not_expressed(joint.parameters, joint.link_name, out.not_expressed);
    list_impossible(body, joint.link_name, 0.0, "libsdformat", out.not_expressed);
    parent = joint.link_name;
  }
  if (const std::string tip = tip_name(robot); !tip.empty()) {
    text += "    <frame" + attribute("name", free_name(tip, "_tip", names)) +
            attribute("attached_to", parent) + ">" + sdf_pose(robot.tip, "") + "</frame>\n";
  }
  text += "  </model>\n</sdf>\n";
  out.not_expressed.push_back("gravity " + triple(robot.gravity) +
                              " m/s^2 in the base frame: a property of the world in SDF");
  detail::list_effects_not_expressed(robot, ExportFormat::sdf, out.not_expressed);
  return out;
}

}  // namespace dynid
