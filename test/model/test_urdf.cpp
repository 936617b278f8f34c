// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/urdf.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <sstream>

#include "dynid/base/file.hpp"
#include "random_robot.hpp"

namespace dynid {
namespace {

using test::error_of;
using test::Random;
using test::replaced;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::string text_of(double value) {
  std::ostringstream out;
  out.precision(17);
  out << value;
  return out.str();
}

std::string text_of(const Eigen::Vector3d& v) {
  return text_of(v[0]) + " " + text_of(v[1]) + " " + text_of(v[2]);
}

// ---------------------------------------------------------------------------------------- round trips

void expect_same_joint(const Joint& a, const Joint& b, double tolerance) {
  SCOPED_TRACE(a.name);
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.link_name, b.link_name);
  EXPECT_EQ(a.type, b.type);
  EXPECT_LT((a.origin.matrix() - b.origin.matrix()).norm(), tolerance);
  EXPECT_LT((a.axis - b.axis).norm(), tolerance);
  EXPECT_LT((a.parameters - b.parameters).norm(), tolerance * (1.0 + a.parameters.norm()));
  EXPECT_EQ(a.limits.lower, b.limits.lower);
  EXPECT_EQ(a.limits.upper, b.limits.upper);
  EXPECT_EQ(a.limits.velocity, b.limits.velocity);
  EXPECT_EQ(a.limits.torque, b.limits.torque);
  EXPECT_EQ(a.friction.linear.viscous, b.friction.linear.viscous);
  EXPECT_EQ(a.friction.linear.coulomb, b.friction.linear.coulomb);
}

class UrdfLaws : public ::testing::TestWithParam<unsigned> {
 protected:
  Random random{GetParam()};
};

TEST_P(UrdfLaws, RobotThroughUrdfIsTheSameRobot) {
  Robot robot = test::random_robot(random, 6);
  robot.gravity = Eigen::Vector3d(0, 0, -9.81);
  const UrdfText urdf = to_urdf(robot);
  EXPECT_TRUE(urdf.not_expressed.empty()) << urdf.not_expressed.front();
  const Robot back = parse_urdf(urdf.text, "text");
  EXPECT_EQ(back.name, robot.name);
  EXPECT_EQ(back.base_link, robot.base_link);
  EXPECT_EQ(back.tip_link, robot.tip_link);
  EXPECT_EQ(back.gravity, robot.gravity);
  ASSERT_EQ(back.size(), robot.size());
  for (std::size_t k = 0; k < 6; ++k) expect_same_joint(robot.joints[k], back.joints[k], 1e-14);
  const Eigen::VectorXd q = test::random_position(random, 6);
  const auto a = test::link_poses(robot, q), b = test::link_poses(back, q);
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_LT((a[k].matrix() - b[k].matrix()).norm(), 1e-13);
  if (HasFailure()) std::printf("%s", urdf.text.c_str());
}

/// A tree of links of which nothing is lumped: what a URDF says before anyone interprets it.
struct Tree {
  struct Node {
    int parent;
    bool fixed;
    JointType type;
    Eigen::Isometry3d origin;
    Eigen::Vector3d axis;
    LinkInertia body;
    Eigen::Isometry3d inertial_frame;
    int chain_joint;  // from 0; -1 where the joint does not follow q
  };
  std::vector<Node> nodes;

  int add(Random& random, int parent, bool fixed, int chain_joint = -1) {
    Node node;
    node.parent = parent;
    node.fixed = fixed;
    node.type = random() % 2 == 0 ? JointType::prismatic : JointType::revolute;
    node.origin = test::random_pose(random);
    node.axis = test::random_direction(random);
    node.body = test::random_link(random);
    node.inertial_frame = test::random_pose(random);
    node.chain_joint = chain_joint;
    nodes.push_back(node);
    return static_cast<int>(nodes.size()) - 1;
  }

  std::string link(int k) const { return "l" + std::to_string(k); }

  std::string urdf() const {
    std::string text = "<robot name=\"tree\"><link name=\"root\"/>\n";
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const Node& n = nodes[k];
      const auto origin = [](const Eigen::Isometry3d& T) {
        const Eigen::Vector3d ypr = T.linear().eulerAngles(2, 1, 0);
        return "<origin xyz=\"" + text_of(T.translation()) + "\" rpy=\"" +
               text_of(Eigen::Vector3d(ypr.reverse())) + "\"/>";
      };
      const Eigen::Matrix3d& I = n.body.inertia;
      const std::string name = link(static_cast<int>(k));
      text += "<link name=\"" + name + "\"><inertial>" + origin(n.inertial_frame) + "<mass value=\"" +
              text_of(n.body.mass) + "\"/><inertia ixx=\"" + text_of(I(0, 0)) + "\" ixy=\"" +
              text_of(I(0, 1)) + "\" ixz=\"" + text_of(I(0, 2)) + "\" iyy=\"" + text_of(I(1, 1)) +
              "\" iyz=\"" + text_of(I(1, 2)) + "\" izz=\"" + text_of(I(2, 2)) + "\"/></inertial></link>\n";
      const char* type = n.fixed ? "fixed" : n.type == JointType::prismatic ? "prismatic" : "continuous";
      text += "<joint name=\"j" + std::to_string(k) + "\" type=\"" + type + "\"><parent link=\"" +
              (n.parent < 0 ? "root" : link(n.parent)) + "\"/><child link=\"" + name + "\"/>" +
              origin(n.origin) + "<axis xyz=\"" + text_of(Eigen::Vector3d(2.5 * n.axis)) +
              "\"/><limit lower=\"-1\" upper=\"1\" effort=\"10\" velocity=\"2\"/></joint>\n";
    }
    return text + "</robot>\n";
  }

  /// Poses of all links at q, and the pseudo-inertia of those that a chain joint moves, in the root's frame.
  Eigen::Matrix4d moving_pseudo_inertia(const Eigen::VectorXd& q,
                                        std::vector<Eigen::Isometry3d>& poses) const {
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    std::vector<bool> moved;
    for (const Node& n : nodes) {
      const auto parent = static_cast<std::size_t>(n.parent < 0 ? 0 : n.parent);
      Eigen::Isometry3d T = n.parent < 0 ? Eigen::Isometry3d::Identity() : poses[parent];
      T = T * n.origin;
      if (n.chain_joint >= 0) T = T * test::motion(n.type, n.axis, q[n.chain_joint]);
      poses.push_back(T);
      moved.push_back(n.chain_joint >= 0 || (n.parent >= 0 && moved[parent]));
      if (!moved.back()) continue;
      LinkInertia centred = n.body;
      centred.com.setZero();
      const Eigen::Matrix4d X = (T * n.inertial_frame).matrix();
      sum += X * pseudo_inertia(to_standard(centred)) * X.transpose();
    }
    return sum;
  }
};

TEST_P(UrdfLaws, LumpedBodiesMoveAsTheyDidApart) {
  Tree tree;
  int at = tree.add(random, -1, true);  // before the first moving joint: part of the base
  tree.add(random, at, true);
  int joints = 0;
  int tip = at;
  while (joints < 4) {
    const bool fixed = random() % 3 == 0;
    at = tree.add(random, at, fixed, fixed ? -1 : joints);
    joints += fixed ? 0 : 1;
    tip = at;
    if (random() % 2 == 0) {  // a branch: fixed, or with a joint that stays at zero, and a link behind it
      const int branch = tree.add(random, at, random() % 2 == 0);
      tree.add(random, branch, random() % 2 == 0);
    }
  }
  tip = tree.add(random, tip, true);
  const std::string text = tree.urdf();
  const Robot robot = parse_urdf(text, "tree", "", tree.link(tip));
  ASSERT_EQ(robot.size(), 4) << text;
  const Eigen::VectorXd q = test::random_position(random, 4);
  std::vector<Eigen::Isometry3d> poses;
  const Eigen::Matrix4d expected = tree.moving_pseudo_inertia(q, poses);
  EXPECT_LT((test::total_pseudo_inertia(robot, q) - expected).norm(), 1e-12 * expected.norm()) << text;
  EXPECT_LT(
      (test::link_poses(robot, q).back().matrix() - poses[static_cast<std::size_t>(tip)].matrix()).norm(),
      1e-12)
      << text;

  // The same tree seen from its first link: gravity turns with the base, and the base's own pose is left out.
  const Robot from_link = parse_urdf(text, "tree", tree.link(0), tree.link(tip));
  EXPECT_LT((poses[0].linear() * from_link.gravity - Eigen::Vector3d(0, 0, -9.81)).norm(), 1e-13);
  EXPECT_LT((from_link.parameters() - robot.parameters()).norm(), 1e-12);
  EXPECT_LT((poses[0] * test::link_poses(from_link, q).back().matrix() -
             poses[static_cast<std::size_t>(tip)].matrix())
                .norm(),
            1e-12);

  // Updating with other parameters leaves every lumped body where it is, and reads back.
  Robot other = robot;
  for (Joint& joint : other.joints) {
    joint.parameters += to_standard(test::random_link(random));
    joint.friction.linear.viscous = test::uniform(random, 0.1, 1);
  }
  const std::string updated = update_urdf(text, "tree", other).text;
  const Robot back = parse_urdf(updated, "tree", "", tree.link(tip));
  EXPECT_LT((back.parameters() - other.parameters()).norm(), 1e-13 * other.parameters().norm()) << updated;
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(back.joints[k].friction.linear.viscous, other.joints[k].friction.linear.viscous);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, UrdfLaws, ::testing::Range(1U, 101U));

// ------------------------------------------------------------------------------------------ by hand

const char* const arm_urdf = R"(<?xml version="1.0"?>
<!-- an arm -->
<robot name="arm">
  <link name="world"/>
  <link name="base"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 1"/></joint>

  <link name="upper">  <!-- keep me -->
    <inertial>
      <origin xyz="0 0 0.1" rpy="0 0 0"/>
      <mass   value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
    <visual><geometry><box size="1 1 1"/></geometry></visual>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3"/>
    <axis xyz="0 0 2"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
    <dynamics damping="0.5" friction="0.25" spring="7"/>
  </joint>
	<link name="lower"/>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/>
    <limit effort="0" velocity="0"/>
  </joint>
  <link name="flange"/>
  <joint name="end" type="fixed"><parent link="lower"/><child link="flange"/><origin xyz="0 0 0.2"/></joint>
</robot>
)";

TEST(Urdf, ReadsFramesLimitsAndFriction) {
  const Robot robot = parse_urdf(arm_urdf, "arm");
  EXPECT_EQ(robot.name, "arm");
  EXPECT_EQ(robot.base_link, "world");
  EXPECT_EQ(robot.tip_link, "flange");
  EXPECT_EQ(robot.tip.translation(), Eigen::Vector3d(0, 0, 0.2));
  ASSERT_EQ(robot.size(), 2);
  const Joint& shoulder = robot.joints[0];
  EXPECT_EQ(shoulder.name, "shoulder");
  EXPECT_EQ(shoulder.link_name, "upper");
  EXPECT_EQ(shoulder.axis, Eigen::Vector3d(0, 0, 1));
  EXPECT_EQ(shoulder.origin.translation(), Eigen::Vector3d(0, 0, 1.3));  // the mount is absorbed
  EXPECT_EQ(shoulder.limits.lower, -1);
  EXPECT_EQ(shoulder.limits.velocity, 2);
  EXPECT_EQ(shoulder.limits.torque, 10);
  EXPECT_EQ(shoulder.friction.linear.viscous, 0.5);
  EXPECT_EQ(shoulder.friction.linear.coulomb, 0.25);
  EXPECT_EQ(shoulder.parameters[0], 2);  // the base's 9 kg are not the arm's
  EXPECT_EQ(shoulder.parameters[3], 0.2);
  const Joint& elbow = robot.joints[1];
  EXPECT_EQ(elbow.type, JointType::continuous);
  EXPECT_EQ(elbow.limits.lower, -infinity);
  EXPECT_EQ(elbow.limits.torque, infinity);  // zero stands for a limit that nobody filled in
  EXPECT_TRUE(elbow.parameters.isZero(0.0));
  EXPECT_EQ(parse_urdf(arm_urdf, "arm", "base", "lower").joints[0].origin.translation(),
            Eigen::Vector3d(0, 0, 0.3));
}

std::string joint_text(const std::string& name, const std::string& type, const std::string& parent,
                       const std::string& child) {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"" + parent +
         "\"/><child link=\"" + child +
         "\"/><axis xyz=\"1 0 0\"/><limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>";
}

TEST(Urdf, TheTipIsFoundWhereThereIsOneWayOn) {
  const auto with = [](const std::string& more) {
    return replaced(arm_urdf, "</robot>", more + "\n</robot>");
  };
  const std::string sensor = "<link name=\"sensor\"/>" + joint_text("s", "fixed", "upper", "sensor");
  EXPECT_EQ(parse_urdf(with(sensor), "arm").tip_link, "flange");
  const std::string tool = "<link name=\"tool\"/>" + joint_text("t", "fixed", "lower", "tool");
  EXPECT_EQ(parse_urdf(with(tool), "arm").tip_link, "lower");  // two fixed ends: neither is chosen
  const std::string fingers = "<link name=\"left\"/><link name=\"right\"/>" +
                              joint_text("f1", "prismatic", "flange", "left") +
                              joint_text("f2", "prismatic", "flange", "right");
  EXPECT_EQ(error_of([&] { parse_urdf(with(fingers), "arm"); }),
            "arm: moving joints branch at link 'flange': choose a base and a tip: --tip flange (2 joints)");
  EXPECT_EQ(parse_urdf(with(fingers), "arm", "", "flange").size(), 2);
  EXPECT_EQ(parse_urdf(with(fingers), "arm", "", "left").size(), 3);
}

struct BadFile {
  const char* from;
  const char* to;
  const char* message;
};

TEST(Urdf, BadFilesAreNamed) {
  const BadFile cases[] = {
      {"</robot>", "", "f:33: malformed XML: no element found"},
      {"<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 0\">", "f:29: malformed XML: mismatched tag"},
      {"<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", "f:24: joint 'elbow': its axis has no direction"},
      {"type=\"continuous\"", "type=\"floating\"",
       "f:24: joint 'elbow': is neither revolute, continuous, prismatic nor fixed"},
      {"type=\"continuous\"", "type=\"planar\"",
       "f:24: joint 'elbow': is neither revolute, continuous, prismatic nor fixed"},
      {"<limit effort=\"0\" velocity=\"0\"/>", "<mimic joint=\"shoulder\"/>",
       "f:24: joint 'elbow': mimics joint 'shoulder': a coupled joint cannot be part of a serial chain"},
      {"<parent link=\"world\"/>", "<parent link=\"flange\"/>", "f:6: joint 'mount': is part of a loop"},
      {"<parent link=\"lower\"/>", "<parent link=\"flange\"/>", "f:31: joint 'end': is part of a loop"},
      {"<child link=\"flange\"/>", "<child link=\"upper\"/>",
       "f:31: joint 'end': link 'upper' hangs from joint 'shoulder' already: a loop, not a tree"},
      {"lower=\"-1\"", "lower=\"3\"",
       "f: robot 'arm': joint 1 ('shoulder'): lower limit 3 is above upper limit 1"},
      {"velocity=\"2\"", "velocity=\"-2\"",
       "f: robot 'arm': joint 1 ('shoulder'): velocity limit -2 is not positive"},
  };
  for (const BadFile& bad : cases) {
    const std::string text = replaced(arm_urdf, bad.from, bad.to);
    EXPECT_EQ(error_of([&] { parse_urdf(text, "f"); }), bad.message)
        << "'" << bad.from << "' -> '" << bad.to << "'";
  }
}

TEST(Urdf, WhatUrdfdomRefusesIsOneLineOfOurs) {
  const BadFile cases[] = {
      {"value=\"2\"", "value=\"nan\"", "mass [nan] is not a float"},
      {"value=\"2\"", "value=\"2 kg\"", "mass [2 kg] is not a float"},
      {"<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>\n", "", "Inertial"},
      {"<child link=\"flange\"/>", "<child link=\"nowhere\"/>", "nowhere"},
      {"<link name=\"flange\"/>", "<link name=\"lower\"/>", "lower"},
      {"<limit lower=\"-1\" upper=\"1\" effort=\"10\" velocity=\"2\"/>", "", "shoulder"},
  };
  for (const BadFile& bad : cases) {
    const std::string text = replaced(arm_urdf, bad.from, bad.to);
    testing::internal::CaptureStderr();
    const std::string error = error_of([&] { parse_urdf(text, "f"); });
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // urdfdom says nothing by itself
    EXPECT_EQ(error.rfind("f: ", 0), 0U) << error;
    EXPECT_NE(error.find(bad.message), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  EXPECT_EQ(error_of([] { parse_urdf("", "f"); }), "f:1: malformed XML: no element found");
  EXPECT_NE(error_of([] { parse_urdf("<sdf/>", "f"); }), "");
  const std::string odd = replaced(arm_urdf, "<box size=\"1 1 1\"/>", "<capsule radius=\"big\"/>");
  EXPECT_EQ(error_of([&] { parse_urdf(odd, "f"); }), "");  // what a robot looks like is not asked for
}

TEST(Urdf, UnknownEndsListTheLeaves) {
  EXPECT_EQ(error_of([] { parse_urdf(arm_urdf, "f", "", "hand"); }),
            "f: unknown tip link 'hand' (leaves: 'flange')");
  EXPECT_EQ(error_of([] { parse_urdf(arm_urdf, "f", "pedestal"); }),
            "f: unknown base link 'pedestal' (leaves: 'flange')");
  EXPECT_EQ(error_of([] { parse_urdf(arm_urdf, "f", "lower", "upper"); }),
            "f: tip link 'upper' does not hang from base link 'lower' (leaves: 'flange')");
  EXPECT_EQ(error_of([] { parse_urdf(arm_urdf, "f", "lower", "flange"); }),
            "f: no moving joint between base 'lower' and tip 'flange'");
  EXPECT_EQ(error_of([] { read_urdf("no/such/file"); }),
            "no/such/file: cannot read: No such file or directory");
}

// ------------------------------------------------------------------------------------------ writing

TEST(Urdf, SaysWhatItCannotExpress) {
  Random random(11);
  Robot robot = test::random_robot(random, 2);
  robot.gravity = Eigen::Vector3d(0, 1, 0);
  robot.joints[0].rotor_inertia = 0.5;
  robot.joints[0].friction.linear.offset = 0.25;
  robot.joints[0].friction.linear.velocity_scale = 0.125;
  robot.joints[1].friction.sigmoid = {1, 2, 3};
  robot.joints[1].limits.jerk = 100;
  robot.joints[1].parameters << 0, 1, 2, 3, 1, 0, 1, 0, 0, 1;
  const std::vector<std::string> expected = {
      "joint 'joint1': smoothing of Coulomb friction below 0.125 rad/s",
      "joint 'joint1': friction offset 0.25 N m",
      "joint 'joint1': rotor inertia 0.5 kg m^2",
      "joint 'joint2': jerk limit 100",
      "joint 'joint2': sigmoid friction phi1 1, phi2 2, phi3 3",
      "link 'link2': mass 0 kg is too small to carry first moments of 1 2 3 kg m",
      "gravity 0 1 0 m/s^2 in the base frame"};
  EXPECT_EQ(to_urdf(robot).not_expressed, expected);
}

TEST(Urdf, ALimitThatIsNotKnownStaysUnknown) {
  Random random(12);
  Robot robot = test::random_robot(random, 2);
  robot.gravity = Eigen::Vector3d(0, 0, -9.81);
  robot.joints[0].type = JointType::revolute;
  robot.joints[1].type = JointType::prismatic;
  for (Joint& joint : robot.joints) joint.limits = JointLimits{};
  const Robot back = parse_urdf(to_urdf(robot).text, "f");
  EXPECT_EQ(back.joints[0].type, JointType::continuous);  // URDF's word for a revolute joint without limits
  robot.joints[0].type = JointType::continuous;
  for (std::size_t k = 0; k < 2; ++k) expect_same_joint(robot.joints[k], back.joints[k], 1e-14);
}

TEST(Urdf, NamesAreEscapedAndMustDiffer) {
  Random random(13);
  Robot robot = test::random_robot(random, 2);
  robot.joints[0].name = "a<b>&\"c\"";
  EXPECT_EQ(parse_urdf(to_urdf(robot).text, "f").joints[0].name, robot.joints[0].name);
  robot.joints[1].link_name = "link1";
  EXPECT_EQ(error_of([&] { to_urdf(robot); }), "robot 'random': two links are called 'link1'");
  robot.joints[1].link_name = "base";
  EXPECT_EQ(error_of([&] { to_urdf(robot); }), "robot 'random': two links are called 'base'");
  robot.joints[1].name = robot.joints[0].name;
  EXPECT_EQ(error_of([&] { to_urdf(robot); }), "robot 'random': two joints are called 'a<b>&\"c\"'");
}

// ------------------------------------------------------------------------------------------ updating

TEST(Urdf, UpdatingChangesNothingElse) {
  Robot robot = parse_urdf(arm_urdf, "arm");
  LinkInertia upper, lower;
  upper.mass = 4;
  upper.com = Eigen::Vector3d(0, 0, 0.5);
  upper.inertia = Eigen::Vector3d(1, 2, 2.5).asDiagonal();
  lower.mass = 1;
  lower.inertia = Eigen::Vector3d(1, 1, 1).asDiagonal();
  robot.joints[0].parameters = to_standard(upper);
  robot.joints[1].parameters = to_standard(lower);
  robot.joints[0].friction.linear = {1.5, 1.25, 0};
  robot.joints[1].friction.linear.viscous = 0.125;
  const UrdfText updated = update_urdf(arm_urdf, "arm", robot);
  EXPECT_TRUE(updated.not_expressed.empty());
  std::string expected = arm_urdf;
  expected = replaced(expected, R"(<origin xyz="0 0 0.1" rpy="0 0 0"/>
      <mass   value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>)",
                      R"(<origin xyz="0 0 0.5" rpy="0 0 0"/>
      <mass value="4"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="2.5"/>)");
  expected = replaced(expected, R"(damping="0.5" friction="0.25" spring="7")",
                      R"(damping="1.5" friction="1.25" spring="7")");
  expected = replaced(expected, R"(<link name="lower"/>)", R"(<link name="lower">
	  <inertial>
	    <origin xyz="0 0 0" rpy="0 0 0"/>
	    <mass value="1"/>
	    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
	  </inertial>
	</link>)");
  expected = replaced(expected, R"(<joint name="elbow" type="continuous">)",
                      R"(<joint name="elbow" type="continuous">
    <dynamics damping="0.125" friction="0"/>)");
  EXPECT_EQ(updated.text, expected);
  EXPECT_EQ(update_urdf(updated.text, "arm", robot).text, updated.text);
}

TEST(Urdf, UpdatingRefusesAnotherRobot) {
  const Robot robot = parse_urdf(arm_urdf, "arm");
  Robot other = robot;
  other.joints[1].name = "knee";
  EXPECT_EQ(error_of([&] { update_urdf(arm_urdf, "f", other); }),
            "f: joint 2 ('knee'): is 'elbow' in the URDF");
  other = robot;
  other.joints[1].type = JointType::prismatic;
  EXPECT_EQ(error_of([&] { update_urdf(arm_urdf, "f", other); }),
            "f: joint 2 ('elbow'): is of another type in the URDF");
  other = robot;
  other.joints[1].origin.translation()[0] += 0.01;
  EXPECT_EQ(error_of([&] { update_urdf(arm_urdf, "f", other); }),
            "f: joint 2 ('elbow'): its frame or its axis is not the URDF's");
  other = robot;
  other.joints.pop_back();
  EXPECT_EQ(error_of([&] { update_urdf(arm_urdf, "f", other); }),
            "f: has 2 moving joints between 'world' and 'flange', robot 'arm' has 1");
}

// -------------------------------------------------------------------------------------------- real data

TEST(Urdf, TheUr10eLoads) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set: ur10e_real/ur10e.urdf";
  const std::string path = std::string(data) + "/ur10e_real/ur10e.urdf";
  const Robot robot = read_urdf(path);
  ASSERT_EQ(robot.size(), 6);
  EXPECT_EQ(robot.base_link, "base_link");
  EXPECT_EQ(robot.tip_link, "wrist_3_link");
  double total = 0.0;
  for (const Joint& joint : robot.joints) total += joint.parameters[0];
  EXPECT_NEAR(total, 7.778 + 12.93 + 3.87 + 1.96 + 1.96 + 0.202, 1e-12);
  EXPECT_EQ(robot.joints[5].limits.torque, 54);
  EXPECT_TRUE(inconsistencies(robot).empty());
  const Robot updated = parse_urdf(update_urdf(read_file(path), path, robot).text, path);
  EXPECT_LT((updated.parameters() - robot.parameters()).norm(), 1e-14);
}

}  // namespace
}  // namespace dynid
