// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "conversions.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/export.hpp"
#include "export_common.hpp"
#include "not_expressed.hpp"

namespace dynid {
namespace {

using namespace detail::exporting;

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
  detail::list_effects_not_expressed(robot, ExportFormat::header, out.not_expressed);
  return out;
}

}  // namespace dynid
