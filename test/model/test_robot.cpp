// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/robot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "random_robot.hpp"

namespace dynid {
namespace {

using test::error_of;
using test::Random;

TEST(Robot, ModifiedDhIsFourElementaryMotions) {
  Random random(1);
  for (int k = 0; k < 100; ++k) {
    const ModifiedDh dh{test::uniform(random, -1, 1), test::uniform(random, -3, 3),
                        test::uniform(random, -1, 1), test::uniform(random, -3, 3)};
    const Eigen::Isometry3d expected =
        Eigen::AngleAxisd(dh.alpha, Eigen::Vector3d::UnitX()) * Eigen::Translation3d(dh.a, 0, 0) *
        Eigen::AngleAxisd(dh.theta, Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(0, 0, dh.d);
    EXPECT_LT((pose(dh).matrix() - expected.matrix()).norm(), 1e-15 * 10) << "case " << k;
  }
}

TEST(Robot, ParametersGoLinkByLinkAndBack) {
  Random random(2);
  Robot robot = test::random_robot(random, 4);
  const Eigen::VectorXd pi = Eigen::VectorXd::LinSpaced(40, 0, 39);
  robot.set_parameters(pi);
  EXPECT_EQ(robot.parameters(), pi);
  EXPECT_EQ(robot.joints[2].parameters[9], 29);
  EXPECT_EQ(error_of([&] { robot.set_parameters(pi.head(39)); }),
            "robot 'random': expected 40 standard parameters, found 39");
}

TEST(Robot, PayloadAddsPseudoInertiasAtTheTip) {
  Random random(3);
  for (int k = 0; k < 20; ++k) {
    const Robot robot = test::random_robot(random, 5);
    const LinkInertia payload = test::random_link(random);
    const Robot loaded = with_payload(robot, payload);
    const Eigen::VectorXd q = test::random_position(random, 5);
    const Eigen::Matrix4d tip = test::link_poses(robot, q).back().matrix();
    const Eigen::Matrix4d expected =
        test::total_pseudo_inertia(robot, q) + tip * pseudo_inertia(to_standard(payload)) * tip.transpose();
    EXPECT_LT((test::total_pseudo_inertia(loaded, q) - expected).norm(), 1e-12 * expected.norm())
        << "case " << k;
  }
  EXPECT_EQ(error_of([] { with_payload(Robot(), LinkInertia()); }),
            "robot 'robot': has no moving joint to carry a payload");
}

TEST(Robot, InconsistenciesNameLinkRuleAndMargin) {
  Random random(4);
  Robot robot = test::random_robot(random, 4);
  EXPECT_TRUE(inconsistencies(robot).empty());

  robot.joints[0].parameters.setZero();  // no inertia at all is passed over
  LinkInertia thin;
  thin.mass = 2.0;
  thin.inertia = Eigen::Vector3d(0.3, 0.1, 0.1).asDiagonal();  // tr/2 - max = -0.05
  robot.joints[1].parameters = to_standard(thin);
  LinkInertia light = test::random_link(random);
  light.mass = -0.5;
  robot.joints[2].parameters = to_standard(light);
  robot.joints[3].parameters << 0, 0.3, 0, 0.4, 1, 0, 1, 0, 0, 1;

  const auto broken = inconsistencies(robot);
  ASSERT_EQ(broken.size(), 3U);
  EXPECT_EQ(broken[0].joint, 2);
  EXPECT_EQ(broken[0].link, "link2");
  EXPECT_NE(broken[0].rule.find("eq. (16)"), std::string::npos);
  EXPECT_NEAR(broken[0].margin, -0.05, 1e-15);
  EXPECT_EQ(broken[1].joint, 3);
  EXPECT_NE(broken[1].rule.find("eq. (11)"), std::string::npos);
  EXPECT_EQ(broken[1].margin, -0.5);
  EXPECT_EQ(broken[2].joint, 4);
  EXPECT_NEAR(broken[2].margin, -0.5, 1e-15);
  EXPECT_EQ(describe(broken[1]),
            "link 'link3' (joint 3) breaks eq. (11): the mass must be positive [kg]: margin -0.5");
}

struct BadRobot {
  const char* message;
  std::function<void(Robot&)> spoil;
};

TEST(Robot, ValidateNamesWhatIsWrong) {
  Random random(5);
  const double nan = std::nan("");
  Robot good = test::random_robot(random, 3);
  EXPECT_EQ(error_of([&] { validate(good); }), "");
  const BadRobot cases[] = {
      {"robot 'random': has no moving joint", [](Robot& r) { r.joints.clear(); }},
      {"robot 'random': gravity is not finite", [&](Robot& r) { r.gravity[1] = nan; }},
      {"robot 'random': tip is not finite", [&](Robot& r) { r.tip.translation()[0] = nan; }},
      {"robot 'random': tip is not a rotation and a translation", [](Robot& r) { r.tip.linear() *= 1.1; }},
      {"robot 'random': joint 2 ('joint2'): axis is not a unit vector",
       [](Robot& r) { r.joints[1].axis.setZero(); }},
      {"robot 'random': joint 1 ('joint1'): origin is not a rotation and a translation",
       [](Robot& r) { r.joints[0].origin.linear().col(0) *= -1; }},
      {"robot 'random': joint 3 ('joint3'): lower limit 2 is above upper limit 1",
       [](Robot& r) {
         r.joints[2].limits = JointLimits{2, 1};
       }},
      {"robot 'random': joint 3 ('joint3'): velocity limit 0 is not positive",
       [](Robot& r) { r.joints[2].limits.velocity = 0; }},
      {"robot 'random': joint 3 ('joint3'): torque limit nan is not positive",
       [&](Robot& r) { r.joints[2].limits.torque = nan; }},
      {"robot 'random': joint 2 ('joint2'): a parameter of link 'link2' is not finite",
       [&](Robot& r) { r.joints[1].parameters[4] = nan; }},
      {"robot 'random': joint 2 ('joint2'): a friction parameter is not finite",
       [&](Robot& r) { r.joints[1].friction.sigmoid.phi2 = INFINITY; }},
      {"robot 'random': joint 2 ('joint2'): rotor inertia is not finite",
       [&](Robot& r) { r.joints[1].rotor_inertia = nan; }},
  };
  for (const BadRobot& bad : cases) {
    Robot robot = good;
    bad.spoil(robot);
    EXPECT_EQ(error_of([&] { validate(robot); }), bad.message);
  }
}

}  // namespace
}  // namespace dynid
