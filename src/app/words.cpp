// SPDX-License-Identifier: Apache-2.0
#include "app/words.hpp"

#include <cstdio>

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
