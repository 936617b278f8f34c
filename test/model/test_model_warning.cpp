// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dynid/model/model_warning.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"
#include "random_robot.hpp"

namespace dynid {
namespace {

Robot published_panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

std::vector<std::string> names(const Robot& robot) {
  std::vector<std::string> out;
  for (const ModelWarning& warning : check_model(robot)) out.push_back(warning.name);
  return out;
}
using Names = std::vector<std::string>;

TEST(ModelWarnings, AGoodModelHasNone) { EXPECT_EQ(names(published_panda()), Names{}); }

TEST(ModelWarnings, EachMistakeIsNamedAlone) {
  Robot robot = published_panda();
  robot.joints[3].parameters.setZero();
  EXPECT_EQ(names(robot), Names{"missing_inertial"});
  EXPECT_EQ(check_model(robot)[0].joints, std::vector<int>{4});
  EXPECT_NE(check_model(robot)[0].text.find("panda_link4"), std::string::npos);

  robot = published_panda();
  for (Joint& joint : robot.joints) {
    joint.parameters *= 1000.0;
    joint.limits.torque *= 1000.0;
  }
  EXPECT_EQ(names(robot), Names{"mass_unit"});

  robot = published_panda();
  robot.joints[1].limits.torque = 0.087;
  EXPECT_EQ(names(robot), Names{"torque_limit"});
  EXPECT_EQ(check_model(robot)[0].joints, std::vector<int>{2});

  robot = published_panda();
  for (Joint& joint : robot.joints) joint.friction.linear.viscous = 10.0;
  EXPECT_EQ(names(robot), Names{"placeholder_damping"});
  for (Joint& joint : robot.joints)
    joint.friction.linear.viscous = 0.31416;  // as one that was fitted might be
  EXPECT_EQ(names(robot), Names{});

  robot = published_panda();
  for (Joint& joint : robot.joints) joint.parameters = robot.joints[0].parameters;
  EXPECT_EQ(names(robot), Names{"placeholder_inertial"});
}

TEST(ModelWarnings, TheSizeOfAnArmDoesNotMatter) {
  for (const double scale : {0.2, 1.0, 5.0}) {
    Robot robot = published_panda();
    for (Joint& joint : robot.joints) {
      joint.dh.reset();
      joint.origin.translation() *= scale;
      LinkInertia link = from_standard(joint.parameters);
      link.mass *= scale * scale * scale;
      link.com *= scale;
      link.inertia *= std::pow(scale, 5);
      joint.parameters = to_standard(link);
      joint.limits.torque *= std::pow(scale, 4);
    }
    EXPECT_EQ(names(robot), Names{}) << scale;
    for (Joint& joint : robot.joints) joint.parameters *= 1000.0, joint.limits.torque *= 1000.0;
    EXPECT_EQ(names(robot), Names{"mass_unit"}) << scale;
  }
}

// ------------------------------------------------------------------------------------------------- URDF

std::string arm_of(const std::string& side, int joints, const std::string& from) {
  std::string text, parent = from;
  for (int j = 1; j <= joints; ++j) {
    const std::string link = side + "_link" + std::to_string(j);
    text += "<link name=\"" + link + "\"/><joint name=\"" + side + "_joint" + std::to_string(j) +
            "\" type=\"continuous\"><parent link=\"" + parent + "\"/><child link=\"" + link +
            "\"/><axis xyz=\"0 0 1\"/></joint>";
    parent = link;
  }
  return text;
}

TEST(UrdfOfOthers, BranchesAreProposedByTheTipOfEachArm) {
  std::string text = "<robot name=\"two arms\"><link name=\"torso\"/>" + arm_of("left", 7, "torso") +
                     arm_of("right", 6, "torso");
  for (const std::string side : {"left", "right"})
    for (const std::string finger : {"a", "b"})
      text += arm_of(side + "_finger_" + finger, 1, side + (side == "left" ? "_link7" : "_link6"));
  text += "</robot>";
  const std::string error = test::error_of([&] { parse_urdf(text, "x.urdf"); });
  EXPECT_NE(error.find("moving joints branch at link 'torso'"), std::string::npos) << error;
  EXPECT_NE(error.find("--tip left_link7 (7 joints)"), std::string::npos) << error;
  EXPECT_NE(error.find("--tip right_link6 (6 joints)"), std::string::npos) << error;
  EXPECT_EQ(error.find("finger"), std::string::npos) << error;
  EXPECT_EQ(parse_urdf(text, "x.urdf", "", "left_link7").size(), 7);
}

TEST(UrdfOfOthers, OtherFormatsAreNamedAsWhatTheyAre) {
  EXPECT_NE(test::error_of([] {
              parse_urdf(
                  "<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:include "
                  "filename=\"a\"/></robot>",
                  "x.urdf");
            }).find("unexpanded xacro"),
            std::string::npos);
  EXPECT_NE(test::error_of([] {
              parse_urdf("<robot name=\"r\"><link name=\"${prefix}base\"/></robot>", "x.urdf");
            }).find("unexpanded xacro"),
            std::string::npos);
  EXPECT_NE(test::error_of([] {
              parse_urdf("<sdf version=\"1.6\"><model name=\"m\"/></sdf>", "x.sdf");
            }).find("this is an SDF"),
            std::string::npos);
}

}  // namespace
}  // namespace dynid
