// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/kdl.hpp"

#include <gtest/gtest.h>

#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "random_robot.hpp"

namespace dynid {
namespace {

using test::error_of;
using test::Random;

KDL::JntArray to_array(const Eigen::VectorXd& v) {
  KDL::JntArray array(static_cast<unsigned>(v.size()));
  array.data = v;
  return array;
}

Eigen::VectorXd kdl_torque(const KDL::Chain& chain, const Eigen::Vector3d& gravity, const Eigen::VectorXd& q,
                           const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(gravity[0], gravity[1], gravity[2]));
  KDL::JntArray tau(chain.getNrOfJoints());
  solver.CartToJnt(to_array(q), to_array(dq), to_array(ddq), KDL::Wrenches(chain.getNrOfSegments()), tau);
  return tau.data;
}

Eigen::VectorXd our_torque(const Robot& robot, const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                           const Eigen::VectorXd& ddq) {
  const Model<> model(robot);
  Workspace<> workspace(model);
  Eigen::VectorXd tau(robot.size());
  inverse_dynamics(model, workspace, q, dq, ddq, tau);
  for (int k = 0; k < robot.size(); ++k)
    tau[k] += robot.joints[static_cast<std::size_t>(k)].rotor_inertia * ddq[k];
  return tau;
}

Eigen::Matrix4d kdl_tip(const KDL::Chain& chain, const Eigen::VectorXd& q) {
  KDL::ChainFkSolverPos_recursive solver(chain);
  KDL::Frame frame;
  solver.JntToCart(to_array(q), frame);
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T(i, j) = frame.M(i, j);
    T(i, 3) = frame.p(i);
  }
  return T;
}

KDL::RigidBodyInertia random_body(Random& random) {
  const LinkInertia link = test::random_link(random);
  const Eigen::Matrix3d& I = link.inertia;
  return KDL::RigidBodyInertia(link.mass, KDL::Vector(link.com[0], link.com[1], link.com[2]),
                               KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)));
}

KDL::Frame random_frame(Random& random) {
  const Eigen::Vector3d p = test::random_vector(random, 0.5);
  const Eigen::Vector3d rpy = test::random_vector(random, 3.0);
  return {KDL::Rotation::RPY(rpy[0], rpy[1], rpy[2]), KDL::Vector(p[0], p[1], p[2])};
}

/// Any chain that KDL can hold: every kind of joint, offsets, scales of +-1, fixed segments, tips off the
/// axes.
KDL::Chain random_chain(Random& random, int segments) {
  using KDL::Joint;
  const Joint::JointType types[] = {Joint::RotX,    Joint::RotY,      Joint::RotZ,
                                    Joint::TransX,  Joint::TransY,    Joint::TransZ,
                                    Joint::RotAxis, Joint::TransAxis, Joint::Fixed};
  KDL::Chain chain;
  for (int k = 0; k < segments; ++k) {
    const Joint::JointType type = k == 1 ? Joint::RotZ : types[random() % 9];
    const double scale = random() % 2 == 0 ? 1.0 : -1.0;
    const double offset = type == Joint::Fixed ? 0.0 : test::uniform(random, -1, 1);
    const double rotor = test::uniform(random, 0, 0.3);
    const double damping = test::uniform(random, 0, 0.3);
    const std::string name = "j" + std::to_string(k);
    const Eigen::Vector3d o = test::random_vector(random, 0.3), a = 2.0 * test::random_direction(random);
    const bool general = type == Joint::RotAxis || type == Joint::TransAxis;
    const Joint joint = general ? Joint(name, KDL::Vector(o[0], o[1], o[2]), KDL::Vector(a[0], a[1], a[2]),
                                        type, scale, offset, rotor, damping)
                                : Joint(name, type, scale, offset, rotor, damping);
    chain.addSegment(KDL::Segment("s" + std::to_string(k), joint, random_frame(random), random_body(random)));
  }
  return chain;
}

class KdlLaws : public ::testing::TestWithParam<unsigned> {
 protected:
  Random random{GetParam()};
};

TEST_P(KdlLaws, RobotThroughKdlIsTheSameRobot) {
  Robot robot = test::random_robot(random, 6);
  for (Joint& joint : robot.joints) joint.rotor_inertia = test::uniform(random, 0, 0.2);
  robot.joints[3].parameters << 0, 0.1, 0.2, -0.3, 1, 0.1, 1, 0.2, 0.3, 1;  // no mass, but first moments
  const Robot back = from_kdl(to_kdl(robot), robot.name, robot.base_link, robot.gravity);
  ASSERT_EQ(back.size(), robot.size());
  EXPECT_EQ(back.tip_link, robot.tip_link);
  EXPECT_LT((back.tip.matrix() - robot.tip.matrix()).norm(), 1e-14);
  for (std::size_t k = 0; k < 6; ++k) {
    const Joint &a = robot.joints[k], &b = back.joints[k];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.link_name, b.link_name);
    EXPECT_EQ(a.type == JointType::prismatic, b.type == JointType::prismatic);
    EXPECT_LT((a.origin.matrix() - b.origin.matrix()).norm(), 1e-14);
    EXPECT_LT((a.axis - b.axis).norm(), 1e-14);
    EXPECT_LT((a.parameters - b.parameters).norm(), 1e-14 * (1 + a.parameters.norm()));
    EXPECT_EQ(a.rotor_inertia, b.rotor_inertia);
    EXPECT_EQ(a.friction.linear.viscous, b.friction.linear.viscous);
  }
}

TEST_P(KdlLaws, KdlAndTheKernelsAgreeOnARobot) {
  Robot robot = test::random_robot(random, 6);
  for (Joint& joint : robot.joints) joint.rotor_inertia = test::uniform(random, 0, 0.2);
  const Eigen::VectorXd q = test::random_position(random, 6), dq = test::random_position(random, 6),
                        ddq = test::random_position(random, 6);
  const KDL::Chain chain = to_kdl(robot);
  const Eigen::VectorXd tau = kdl_torque(chain, robot.gravity, q, dq, ddq);
  EXPECT_LT((our_torque(robot, q, dq, ddq) - tau).norm(), 1e-11 * tau.norm());
  EXPECT_LT((test::link_poses(robot, q).back().matrix() - kdl_tip(chain, q)).norm(), 1e-13);
}

TEST_P(KdlLaws, KdlAndTheKernelsAgreeOnAChain) {
  const KDL::Chain chain = random_chain(random, 8);
  const Eigen::Vector3d gravity = test::random_vector(random, 10);
  const Robot robot = from_kdl(chain, "r", "b", gravity);
  const int n = static_cast<int>(chain.getNrOfJoints());
  ASSERT_EQ(robot.size(), n);
  const Eigen::VectorXd q = test::random_position(random, n), dq = test::random_position(random, n),
                        ddq = test::random_position(random, n);
  const Eigen::VectorXd tau = kdl_torque(chain, gravity, q, dq, ddq);
  EXPECT_LT((our_torque(robot, q, dq, ddq) - tau).norm(), 1e-11 * tau.norm());
  EXPECT_LT((test::link_poses(robot, q).back().matrix() - kdl_tip(chain, q)).norm(), 1e-13);
  const Eigen::VectorXd again = kdl_torque(to_kdl(robot), gravity, q, dq, ddq);
  EXPECT_LT((again - tau).norm(), 1e-11 * tau.norm());
}

INSTANTIATE_TEST_SUITE_P(Seeds, KdlLaws, ::testing::Range(1U, 101U));

TEST(Kdl, UnnamedJointsGetNamesAndBadChainsAreRefused) {
  KDL::Chain chain;
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ)));
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::TransX)));
  const Robot robot = from_kdl(chain);
  EXPECT_EQ(robot.joints[0].name, "joint1");
  EXPECT_EQ(robot.joints[1].name, "joint2");
  EXPECT_EQ(robot.joints[1].link_name, "link2");
  EXPECT_EQ(robot.tip_link, "link2");

  EXPECT_EQ(error_of([] { from_kdl(KDL::Chain()); }), "KDL chain: robot 'robot': has no moving joint");
  chain.addSegment(KDL::Segment(KDL::Joint("geared", KDL::Joint::RotZ, 2.0)));
  EXPECT_EQ(error_of([&] { from_kdl(chain); }), "KDL chain: joint 3 ('geared'): its scale is not 1 or -1");
}

}  // namespace
}  // namespace dynid
