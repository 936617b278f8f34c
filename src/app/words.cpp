// SPDX-License-Identifier: Apache-2.0
#include "app/words.hpp"

#include <algorithm>
#include <cstdio>
#include <functional>

#include "dynid/base/text.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/effect/derived.hpp"
#include "dynid/model/link_inertia.hpp"

namespace dynid::detail {

const char* word_for(JointType type) {
  return type == JointType::revolute     ? "revolute"
         : type == JointType::continuous ? "continuous"
                                         : "prismatic";
}

const char* word_for(Identifiable answer) {
  return answer == Identifiable::alone            ? "alone"
         : answer == Identifiable::in_combination ? "in combination"
                                                  : "no";
}

std::string units_in_words(const std::vector<std::string>& unit) {
  const bool same = std::adjacent_find(unit.begin(), unit.end(), std::not_equal_to<>()) == unit.end();
  return same && !unit.empty() ? unit.front() : join(unit, " | ");
}

std::string torque_units(const Robot& robot) {
  std::vector<std::string> unit;
  for (const Joint& joint : robot.joints) unit.push_back(joint_units(joint.type).torque);
  return units_in_words(unit);
}

std::string position_units(const Robot& robot) {
  std::vector<std::string> unit;
  for (const Joint& joint : robot.joints) unit.push_back(joint_units(joint.type).position);
  return units_in_words(unit);
}

std::string payload_place(const Robot& robot, const Effect& effect) {
  if (effect.name != "payload") return "";
  const LinkInertia body = from_standard(payload_body(robot, effect));
  if (!(body.mass > 0.0)) return "";
  const Eigen::Vector3d from_flange = robot.tip.inverse() * body.com;
  char text[160];
  std::snprintf(text, sizeof text,
                "com from the flange %.4g %.4g %.4g [m], in the last link's frame %.4g %.4g %.4g [m]",
                from_flange.x(), from_flange.y(), from_flange.z(), body.com.x(), body.com.y(), body.com.z());
  return text;
}

}  // namespace dynid::detail
