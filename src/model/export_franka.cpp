// SPDX-License-Identifier: Apache-2.0
#include "conversions.hpp"
#include "dynid/model/export.hpp"
#include "export_common.hpp"
#include "not_expressed.hpp"

namespace dynid {
namespace {

using namespace detail::exporting;

/// YAML 1.1, and with it xacro's reader, takes 1e-05 for a text: a number needs its point.
std::string yaml_number(double value) {
  std::string text = number(value);
  const auto exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

}  // namespace

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
  detail::list_effects_not_expressed(robot, ExportFormat::franka, out.not_expressed);
  return out;
}

}  // namespace dynid
