// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/export.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

#include "conversions.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "not_expressed.hpp"

namespace dynid {
namespace {

using detail::list_effects_not_expressed;

constexpr double unlimited = 1e16;  // what simulators write, and take, for a limit that there is not

/// What is written is read again as the same double.
std::string number(double x) { return exact_number(x); }

std::string triple(const Eigen::Vector3d& v) {
  return number(v[0] + 0.0) + " " + number(v[1] + 0.0) + " " + number(v[2] + 0.0);  // -0 becomes 0
}

std::string attribute(const char* key, const std::string& value) {
  return std::string(" ") + key + "=\"" + xml_escaped(value) + "\"";
}

bool bounded(const JointLimits& limits) { return std::isfinite(limits.lower) || std::isfinite(limits.upper); }

std::string position_limit(double value) { return number(std::clamp(value, -unlimited, unlimited)); }

void check_names(const Robot& robot) {
  std::set<std::string> joints, links{robot.base_link};
  for (const Joint& joint : robot.joints) {
    if (!joints.insert(joint.name).second)
      throw Error("robot '" + robot.name + "': two joints are called '" + joint.name + "'");
    if (!links.insert(joint.link_name).second)
      throw Error("robot '" + robot.name + "': two links are called '" + joint.link_name + "'");
    if (joint.link_name == "world")
      throw Error("robot '" + robot.name + "': link 'world' moves; simulators keep this name for themselves");
  }
}

/// The tip's name where the tip is more than the last link itself, else empty.
std::string tip_name(const Robot& robot) {
  const bool at_last_link = robot.tip.matrix().isIdentity(0.0);
  return at_last_link && robot.tip_link == robot.joints.back().link_name ? "" : robot.tip_link;
}

/// What no simulator's file has a word for.
void list_joint_not_expressed(const Joint& joint, std::vector<std::string>& list) {
  const std::string prefix = "joint '" + joint.name + "': ";
  detail::list_friction_not_expressed(joint.friction, prefix, list);
  if (std::isfinite(joint.limits.acceleration))
    list.push_back(prefix + "acceleration limit " + number(joint.limits.acceleration));
  if (std::isfinite(joint.limits.jerk)) list.push_back(prefix + "jerk limit " + number(joint.limits.jerk));
  if (std::isfinite(joint.limits.torque_rate))
    list.push_back(prefix + "torque rate limit " + number(joint.limits.torque_rate));
}

void list_first_moments_not_expressed(const StandardParameters& p, const std::string& link,
                                      std::vector<std::string>& list) {
  if (detail::has_centre_of_mass(p)) return;
  list.push_back("link '" + link + "': mass " + number(p[0]) + " kg is too small to carry first moments of " +
                 triple(p.segment<3>(1)) + " kg m");
}

// ---------------------------------------------------------------------------------------------------- bodies

/// Central inertia along its principal axes, moments ascending.
struct PrincipalInertia {
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  // at the centre of mass, in the link frame
  Eigen::Vector3d moments;
};

PrincipalInertia principal_inertia(const LinkInertia& body) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(body.inertia);
  PrincipalInertia principal;
  principal.moments = solver.eigenvalues();
  principal.frame.linear() = solver.eigenvectors();
  if (solver.eigenvectors().determinant() < 0.0) principal.frame.linear().col(0) *= -1.0;
  principal.frame.translation() = body.com;
  // A flat body is on the border of eq. (16): rounding must not put it beyond, for the simulators' tests are
  // exact. The rounding is that of the tensor about the link's origin, which the central one came from.
  Eigen::Vector3d& m = principal.moments;
  const double rounding = 1e-14 * (m[2] + body.mass * body.com.squaredNorm());
  if (m[0] < 0.0 && m[0] >= -rounding) m[0] = 0.0;
  if (m[2] > m[0] + m[1] && m[2] - m[0] - m[1] <= rounding) m[2] = m[0] + m[1];
  return principal;
}

/// Eqs. (11) and (16) as the simulators check them; `least`: the least mass and moment that they take.
void list_impossible(const LinkInertia& body, const std::string& link, double least,
                     const std::string& program, std::vector<std::string>& list) {
  const Eigen::Vector3d m = principal_inertia(body).moments;
  if (body.mass >= least && m[0] >= least && m[0] + m[1] >= m[2]) return;
  list.push_back("link '" + link + "': mass " + number(body.mass) + " kg with principal moments " +
                 triple(m) + " kg m^2, which " + program + " refuses");
}

// ------------------------------------------------------------------------------------------------------ MJCF

std::string mjcf_pose(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return attribute("pos", triple(pose.translation())) +
         attribute("quat", number(q.w()) + " " + number(q.x()) + " " + number(q.y()) + " " + number(q.z()));
}

std::string mjcf_inertial(const LinkInertia& body) {
  const PrincipalInertia principal = principal_inertia(body);
  return "<inertial" + mjcf_pose(principal.frame) + attribute("mass", number(body.mass)) +
         attribute("diaginertia", triple(principal.moments)) + "/>\n";
}

/// Springs at joint `k`, in parallel.
struct Spring {
  double stiffness = 0.0, moment = 0.0;  // [N m/rad], stiffness times rest position [N m]
};

Spring spring_of(const Robot& robot, std::size_t k) {
  LoopTerms terms(robot.size());
  for (const Effect& effect : robot.effects) {
    const EffectSchema* const schema = find_effect_schema(effect.name);
    if (schema != nullptr && detail::says(*schema, ExportFormat::mjcf))
      schema->compile(terms, checked_effect(effect, robot));
  }
  const auto j = static_cast<Eigen::Index>(k);
  return {terms.stiffness[j], -terms.offset[j]};
}

std::string mjcf_joint(const Joint& joint, const Spring& spring, std::vector<std::string>& list) {
  const std::string prefix = "joint '" + joint.name + "': ";
  const JointLimits& limits = joint.limits;
  const LinearFriction& friction = joint.friction.linear;
  std::string text = "<joint" + attribute("name", joint.name) +
                     attribute("type", joint.type == JointType::prismatic ? "slide" : "hinge") +
                     attribute("axis", triple(joint.axis));
  if (limits.lower == limits.upper) {
    list.push_back(prefix + "position limits that are both " + number(limits.lower));
  } else if (bounded(limits)) {
    text += attribute("limited", "true") +
            attribute("range", position_limit(limits.lower) + " " + position_limit(limits.upper));
  }
  if (friction.viscous != 0.0) text += attribute("damping", number(friction.viscous));
  if (friction.coulomb > 0.0) text += attribute("frictionloss", number(friction.coulomb));
  if (joint.rotor_inertia > 0.0) text += attribute("armature", number(joint.rotor_inertia));
  if (spring.stiffness > 0.0)
    text += attribute("stiffness", number(spring.stiffness)) +
            attribute("springref", number(spring.moment / spring.stiffness + 0.0));
  else if (spring.stiffness < 0.0 || spring.moment != 0.0)
    list.push_back(prefix + "spring of stiffness " + number(spring.stiffness) + " " +
                   unit_of("N m/rad", joint.type));
  if (friction.coulomb < 0.0)
    list.push_back(prefix + "negative Coulomb friction " + number(friction.coulomb) + " N m");
  if (joint.rotor_inertia < 0.0)
    list.push_back(prefix + "negative rotor inertia " + number(joint.rotor_inertia) + " kg m^2");
  if (std::isfinite(limits.velocity)) list.push_back(prefix + "velocity limit " + number(limits.velocity));
  list_joint_not_expressed(joint, list);
  return text + "/>\n";
}

std::string mjcf_motor(const Joint& joint) {
  const double limit = joint.limits.torque;
  std::string text = "    <motor" + attribute("name", joint.name) + attribute("joint", joint.name);
  if (std::isfinite(limit))
    text += attribute("ctrllimited", "true") + attribute("ctrlrange", number(-limit) + " " + number(limit));
  return text + "/>\n";
}

// ------------------------------------------------------------------------------------------------------- SDF

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

// ------------------------------------------------------------------------------------------------------ YAML

/// YAML 1.1, and with it xacro's reader, takes 1e-05 for a text: a number needs its point.
std::string yaml_number(double value) {
  std::string text = number(value);
  const auto exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

// ---------------------------------------------------------------------------------------------------- header

/// One line of comment: a backslash at its end would make the next line part of it.
std::string comment(const std::string& text) {
  std::string line = one_line(text);
  std::replace(line.begin(), line.end(), '\\', ' ');
  return line;
}

/// A name that C++ takes for a namespace: every other sign becomes an underscore.
std::string identifier(const std::string& name) {
  std::string text;
  for (const char c : name) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    text += letter || (c >= '0' && c <= '9') ? c : '_';
  }
  const bool bare = text.empty() || text[0] == '_' || (text[0] >= '0' && text[0] <= '9');
  return (bare ? "robot" : "") + text + "_model";  // which is no keyword
}

/// `viscous, coulomb, offset, velocity_scale, eq. (24); phi1, ...`: the columns of the table of friction.
std::string friction_legend() {
  std::vector<std::string> laws;
  const auto add = [&laws](const auto& law) {
    std::vector<std::string> keys;
    for (const auto& p : law.parameters()) keys.emplace_back(p.key);
    keys.emplace_back(law.equation);
    laws.push_back(join(keys));
  };
  std::apply([&add](const auto&... law) { (add(law), ...); }, JointFriction().laws());
  return join(laws, "; ");
}

int friction_columns() {
  int columns = 0;
  for_each_parameter(JointFriction(), [&columns](const auto&, const auto&) { ++columns; });
  return columns;
}

/// The lines of make_robot() that fill a joint's laws from its row of the table.
std::string friction_assignments() {
  std::string text;
  int column = 0;
  const auto add = [&](const auto& law) {
    std::vector<std::string> values;
    for (std::size_t k = 0; k < law.parameters().size(); ++k)
      values.push_back("friction[k][" + std::to_string(column++) + "]");
    text += std::string("    joint.friction.") + law.name + " = {" + join(values) + "};\n";
  };
  std::apply([&add](const auto&... law) { (add(law), ...); }, JointFriction().laws());
  return text;
}

/// A string literal; what is not plain ASCII, and what could make a trigraph or end it, as octal.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code >= 32 && code < 127 && c != '"' && c != '\\' && c != '?') {
      out += c;
      continue;
    }
    out += '\\';
    for (int shift = 6; shift >= 0; shift -= 3) out += static_cast<char>('0' + ((code >> shift) & 7));
  }
  return out + "\"";
}

}  // namespace

ExportText to_mjcf(const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  check_names(robot);
  ExportText out;
  std::string& text = out.text;
  // The zero bounds and the lone inertials keep MuJoCo from making anything of its own out of the numbers.
  text = "<mujoco" + attribute("model", robot.name) + ">\n" +
         "  <compiler angle=\"radian\" inertiafromgeom=\"false\" boundmass=\"0\" boundinertia=\"0\"/>\n" +
         "  <option" + attribute("gravity", triple(robot.gravity)) + "/>\n  <worldbody>\n";
  std::string indent = "    ", motors;
  std::size_t open = 0;
  const auto open_body = [&](const std::string& name, const std::string& pose) {
    text += indent + "<body" + attribute("name", name) + pose + ">\n";
    indent += "  ";
    ++open;
  };
  if (robot.base_link != "world") open_body(robot.base_link, "");
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const Joint& joint = robot.joints[k];
    const LinkInertia body = from_standard(joint.parameters);
    open_body(joint.link_name, mjcf_pose(joint.origin));
    text += indent + mjcf_inertial(body) + indent + mjcf_joint(joint, spring_of(robot, k), out.not_expressed);
    motors += mjcf_motor(joint);
    list_first_moments_not_expressed(joint.parameters, joint.link_name, out.not_expressed);
    constexpr double least = 1e-15;  // mjMINVAL
    list_impossible(body, joint.link_name, least, "MuJoCo", out.not_expressed);
  }
  const std::string tip = tip_name(robot);
  if (!tip.empty()) text += indent + "<site" + attribute("name", tip) + mjcf_pose(robot.tip) + "/>\n";
  for (; open > 0; --open) {
    indent.resize(indent.size() - 2);
    text += indent + "</body>\n";
  }
  text += "  </worldbody>\n  <actuator>\n" + motors + "  </actuator>\n</mujoco>\n";
  list_effects_not_expressed(robot, ExportFormat::mjcf, out.not_expressed);
  return out;
}

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
  list_effects_not_expressed(robot, ExportFormat::sdf, out.not_expressed);
  return out;
}

ExportText to_franka_inertials(const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  ExportText out;
  int k = 0;
  for (const Joint& joint : robot.joints) {
    const LinkInertia body = from_standard(joint.parameters);
    const Eigen::Matrix3d& I = body.inertia;
    const auto entry = [&](const char* key, double value) {
      return "    " + std::string(key) + ": " + yaml_number(value) + "\n";
    };
    out.text += "link" + std::to_string(++k) + ":\n  origin:\n    xyz: " + triple(body.com) +
                "\n    rpy: 0 0 0\n  mass: " + yaml_number(body.mass) + "\n  inertia:\n" +
                entry("xx", I(0, 0)) + entry("xy", I(0, 1)) + entry("xz", I(0, 2)) + entry("yy", I(1, 1)) +
                entry("yz", I(1, 2)) + entry("zz", I(2, 2));
    list_first_moments_not_expressed(joint.parameters, joint.link_name, out.not_expressed);
  }
  out.not_expressed.emplace_back("everything but the inertia of the moving links: frames, limits, friction");
  list_effects_not_expressed(robot, ExportFormat::franka, out.not_expressed);
  return out;
}

ExportText to_header(const Robot& given) {
  validate(given);
  const Robot robot = with_effects_entered(given);
  ExportText out;
  const int n = robot.size();
  const std::string size = "[" + std::to_string(n) + "]";
  const auto literal = [](double value) {
    return std::isinf(value) ? std::string(value < 0.0 ? "-none" : "none") : number(value);
  };
  const auto row = [&](const std::vector<double>& values) {
    std::string text;
    for (const double value : values) text += (text.empty() ? "{" : ", ") + literal(value);
    return text + "}";
  };
  const auto pose = [&](const Eigen::Isometry3d& T) {
    std::vector<double> values;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) values.push_back(T(r, c));
    return row(values);
  };
  const auto table = [&](const std::string& declaration, const std::string& about, const auto& entry) {
    out.text += "/// " + about + "\nconstexpr " + declaration + " = {\n";
    for (const Joint& joint : robot.joints) out.text += "    " + entry(joint) + ",\n";
    out.text += "};\n";
  };
  out.text =
      "// Robot '" + comment(robot.name) +
      "', written by dynid export: no include but the standard library's.\n"
      "// With dynid::core: const dynid::Model<" +
      std::to_string(n) + "> model(" + identifier(robot.name) +
      "::make_robot<dynid::Robot>());\n#pragma once\n\n"
      "#include <limits>\n\nnamespace " +
      identifier(robot.name) +
      " {\n\n"
      "constexpr int joints = " +
      std::to_string(n) +
      ";\n"
      "constexpr double none = std::numeric_limits<double>::infinity();  ///< where a limit is not known\n"
      "constexpr char name[] = " +
      quoted(robot.name) + ", base_link[] = " + quoted(robot.base_link) +
      ", tip_link[] = " + quoted(robot.tip_link) + ";\n";
  table("const char* joint_names" + size, "Joints, base to tip.",
        [&](const Joint& joint) { return quoted(joint.name); });
  table("const char* link_names" + size, "The links that they carry.",
        [&](const Joint& joint) { return quoted(joint.link_name); });
  table("char types" + size, "'r' revolute, 'c' continuous, 'p' prismatic.", [](const Joint& joint) {
    return std::string(joint.type == JointType::prismatic    ? "'p'"
                       : joint.type == JointType::continuous ? "'c'"
                                                             : "'r'");
  });
  table("double origins" + size + "[12]",
        "Link frame at q = 0 in the parent's link frame: [R p], 3 x 4 row by row, m.",
        [&](const Joint& joint) { return pose(joint.origin); });
  table("double axes" + size + "[3]", "Joint axis, unit vector in the link frame.", [&](const Joint& joint) {
    return row({joint.axis[0], joint.axis[1], joint.axis[2]});
  });
  table("double parameters" + size + "[10]",
        "m, mx, my, mz, xx, xy, yy, xz, yz, zz about the origin of the link frame: kg, kg m, kg m^2.",
        [&](const Joint& joint) {
          return row({joint.parameters.data(), joint.parameters.data() + 10});
        });
  table("double friction" + size + "[" + std::to_string(friction_columns()) + "]", friction_legend() + ".",
        [&](const Joint& joint) {
          std::vector<double> values;
          for_each_parameter(joint.friction,
                             [&](const auto& law, const auto& p) { values.push_back(law.*p.value); });
          return row(values);
        });
  table("double rotor_inertias" + size, "On the joint's side of the gear, kg m^2.",
        [&](const Joint& joint) { return literal(joint.rotor_inertia); });
  table("double limits" + size + "[7]",
        "Position (lower, upper), velocity, acceleration, jerk, torque, torque rate.",
        [&](const Joint& joint) {
          const JointLimits& l = joint.limits;
          return row({l.lower, l.upper, l.velocity, l.acceleration, l.jerk, l.torque, l.torque_rate});
        });
  out.text +=
      "/// The tip in the last link's frame, as the origins.\nconstexpr double tip[12] = " + pose(robot.tip) +
      ";\n/// In the base frame, m/s^2.\nconstexpr double gravity[3] = " +
      row({robot.gravity[0], robot.gravity[1], robot.gravity[2]}) + ";\n";
  out.text += R"(
/// All of it as a dynid::Robot, which is named where this is called so that nothing needs including here.
template <class Robot>
Robot make_robot() {
  Robot robot;
  robot.name = name;
  robot.base_link = base_link;
  robot.tip_link = tip_link;
  robot.joints.resize(joints);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) robot.tip(r, c) = tip[4 * r + c];
    robot.gravity[r] = gravity[r];
  }
  for (int k = 0; k < joints; ++k) {
    auto& joint = robot.joints[k];
    using Type = decltype(joint.type);
    joint.name = joint_names[k];
    joint.link_name = link_names[k];
    joint.type = types[k] == 'p' ? Type::prismatic : types[k] == 'c' ? Type::continuous : Type::revolute;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) joint.origin(r, c) = origins[k][4 * r + c];
      joint.axis[r] = axes[k][r];
    }
    for (int i = 0; i < 10; ++i) joint.parameters[i] = parameters[k][i];
)" + friction_assignments() +
              R"(    joint.rotor_inertia = rotor_inertias[k];
    joint.limits = {limits[k][0], limits[k][1], limits[k][2], limits[k][3],
                    limits[k][4], limits[k][5], limits[k][6]};
  }
  return robot;
}

}  // namespace )" +
              identifier(robot.name) + "\n";
  list_effects_not_expressed(robot, ExportFormat::header, out.not_expressed);
  return out;
}

}  // namespace dynid
