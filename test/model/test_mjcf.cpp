// SPDX-License-Identifier: Apache-2.0
//
// MJCF in, with the libmujoco that the library was built with: its own mass matrix and bias are the measure.
#include "dynid/model/mjcf.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/robot_file.hpp"
#ifdef DYNID_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace dynid {
namespace {

/// Defaults and childclass, a hinge and a slide off their body's origin, references, two joints on a body.
const char* const arm = R"(<mujoco model="arm">
  <compiler angle="degree"/>
  <option gravity="0.3 -1 -9.5" integrator="Euler"/>
  <default>
    <joint damping="0.4" armature="0.03" frictionloss="0.1"/>
    <position kp="30" forcerange="-5 5" forcelimited="true"/>
    <default class="outer"><joint damping="0.2" limited="true" range="-90 80"/><position kv="1.5"/></default>
  </default>
  <worldbody>
    <body name="base" pos="0.1 0 0.2" euler="10 20 30">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="upper" pos="0 0 0.1" euler="0 0 40">
        <inertial pos="0.01 -0.02 0.1" mass="2.5" fullinertia="0.03 0.04 0.02 0.004 -0.003 0.002"/>
        <joint name="a" axis="0 1 0" pos="0.01 0.02 0.03"/>
        <body name="fore" pos="0 0.05 0.3" quat="0.7 0.1 -0.5 0.3" childclass="outer">
          <inertial pos="0 0.05 0.1" quat="0.9 0.1 0.2 0.3" mass="1.5" diaginertia="0.012 0.02 0.025"/>
          <joint name="b" type="slide" axis="0 1 0.2" ref="0.05"/>
          <body name="hand" pos="0.2 0 0.1">
            <inertial pos="0.03 0 0.02" mass="0.8" fullinertia="0.002 0.0025 0.0021 0.0001 0.0002 -0.0001"/>
            <joint name="c" axis="1 1 0" ref="25"/>
            <joint name="d" axis="0 0 1" pos="0 0.1 0" stiffness="4" springref="10"/>
            <body name="tip" pos="0 0 0.1"><geom type="sphere" size="0.01" mass="0.1"/></body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="pa" joint="a"/>
    <position name="pc" joint="c" class="outer"/>
    <motor name="md" joint="d" gear="3" forcelimited="true" forcerange="-2 2"/>
  </actuator>
</mujoco>)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// What reading the text as a file `arm.xml` says.
std::string error_of(const std::string& text, const std::string& base = "", const std::string& tip = "") {
  try {
    read_mjcf("arm.xml", base, tip, &text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(MjcfText, KeepsWhatTheRobotIs) {
  const MjcfText text = parse_mjcf_text(arm, "arm.xml");
  EXPECT_EQ(text.position_kv, (std::vector<double>{0.0, 1.5, 0.0}));
  EXPECT_EQ(text.text.find("kv="), std::string::npos);
  EXPECT_EQ(text.text.find("integrator"), std::string::npos);
  EXPECT_TRUE(is_mjcf(arm));
  EXPECT_FALSE(is_mjcf("<robot name='x'/>"));
}

TEST(MjcfText, FaultsAreNamed) {
  EXPECT_NE(error_of(replaced(arm, "</worldbody>", "")).find("arm.xml:"), std::string::npos);
  EXPECT_NE(error_of(replaced(arm, "</worldbody>", "")).find("not well-formed"), std::string::npos);
  const std::string mesh =
      replaced(arm, "<worldbody>", "<asset><mesh name='m' file='none.stl'/></asset><worldbody>");
  // With an explicit inertial a mesh that is not there changes nothing; without one it is missing.
  const std::string seen =
      replaced(mesh, "<joint name=\"a\"", "<geom type='mesh' mesh='m'/><joint name=\"a\"");
  EXPECT_EQ(parse_mjcf_text(seen, "arm.xml").missing, std::vector<std::string>{"none.stl"});
  const std::string carried = replaced(mesh, "<body name=\"tip\" pos=\"0 0 0.1\">",
                                       "<body name=\"tip\"><geom type='mesh' mesh='m'/>");
  EXPECT_NE(error_of(carried).find("body 'tip' takes its inertia from its geoms, and none.stl is not there"),
            std::string::npos);
}

#ifdef DYNID_HAVE_MUJOCO

TEST(Mjcf, EverythingIsTheRobots) {
  const std::string text = arm;
  const MjcfRobot read = read_mjcf("arm.xml", "", "", &text);
  const Robot& robot = read.robot;
  ASSERT_EQ(robot.size(), 4);
  EXPECT_EQ(robot.base_link, "base");
  EXPECT_EQ(robot.tip_link, "tip");
  EXPECT_EQ(robot.joints[1].type, JointType::prismatic);
  EXPECT_DOUBLE_EQ(robot.joints[0].friction.linear.viscous, 0.4);
  EXPECT_DOUBLE_EQ(robot.joints[2].friction.linear.viscous, 0.2);
  EXPECT_DOUBLE_EQ(robot.joints[2].friction.linear.coulomb, 0.1);
  EXPECT_DOUBLE_EQ(robot.joints[3].rotor_inertia, 0.03);
  EXPECT_NEAR(robot.joints[2].limits.upper, 80.0 * M_PI / 180.0, 1e-12);
  ASSERT_TRUE(robot.joints[0].servo && robot.joints[2].servo);
  EXPECT_FALSE(robot.joints[3].servo);
  EXPECT_DOUBLE_EQ(robot.joints[0].servo->kp, 30.0);
  EXPECT_DOUBLE_EQ(robot.joints[0].servo->kd, 0.0);
  EXPECT_DOUBLE_EQ(robot.joints[2].servo->kd, 1.5);
  EXPECT_DOUBLE_EQ(robot.joints[2].servo->torque_limit, 5.0);
  EXPECT_DOUBLE_EQ(robot.joints[3].limits.torque, 6.0);
  ASSERT_EQ(robot.effects.size(), 1u);
  EXPECT_EQ(robot.effects[0].name, "joint_spring");
  EXPECT_DOUBLE_EQ(robot.effects[0].parameters.at("stiffness")[3], 4.0);
}

/// M and the bias of mj_forward() at random states, to 1e-10 of their largest entries.
TEST(Mjcf, MassMatrixAndBiasAreMujocos) {
  const std::string text = arm;
  const Robot robot = read_mjcf("arm.xml", "", "", &text).robot;
  const std::string compiled = parse_mjcf_text(text, "arm.xml").text;
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  mj_makeEmptyFileVFS(vfs.get(), "arm.xml", static_cast<int>(compiled.size()));
  std::copy(compiled.begin(), compiled.end(), static_cast<char*>(vfs->filedata[0]));
  char error[1000] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> m(mj_loadXML("arm.xml", vfs.get(), error, sizeof(error)),
                                                       &mj_deleteModel);
  mj_deleteVFS(vfs.get());
  ASSERT_TRUE(m) << error;
  const std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), &mj_deleteData);
  const Model<> model(robot);
  Workspace<> ws(model);
  const int n = robot.size();
  Eigen::VectorXd armature(n);
  for (int j = 0; j < n; ++j) armature[j] = robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
  std::srand(11);
  for (int k = 0; k < 100; ++k) {
    const Eigen::VectorXd q = Eigen::VectorXd::Random(n) * 2.0, dq = Eigen::VectorXd::Random(n) * 2.0;
    Eigen::Map<Eigen::VectorXd>(d->qpos, n) = q;
    Eigen::Map<Eigen::VectorXd>(d->qvel, n) = dq;
    mj_forward(m.get(), d.get());
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> theirs(n, n);
    mj_fullM(m.get(), theirs.data(), d->qM);
    Eigen::MatrixXd M(n, n);
    mass_matrix(model, ws, q, M);
    M.diagonal() += armature;
    EXPECT_LE((M - theirs).cwiseAbs().maxCoeff(), 1e-10 * theirs.cwiseAbs().maxCoeff());
    Eigen::VectorXd tau(n);
    inverse_dynamics(model, ws, q, dq, Eigen::VectorXd::Zero(n).eval(), tau);
    const Eigen::Map<Eigen::VectorXd> bias(d->qfrc_bias, n);
    EXPECT_LE((tau - bias).cwiseAbs().maxCoeff(), 1e-10 * bias.cwiseAbs().maxCoeff());
  }
}

TEST(Mjcf, WhatMujocoDoesNotKnowIsNamedWithItsVersion) {
  const std::string text = error_of(replaced(arm, "<joint name=\"a\"", "<joint notyet=\"1\" name=\"a\""));
  EXPECT_NE(text.find("arm.xml: MuJoCo "), std::string::npos) << text;
  EXPECT_NE(text.find("notyet"), std::string::npos) << text;
  EXPECT_EQ(text.find('\n'), std::string::npos) << text;
}

TEST(Mjcf, ChoicesAreAskedFor) {
  const std::string branched = replaced(arm, "<body name=\"tip\" pos=\"0 0 0.1\">",
                                        "<body name=\"finger\"><joint name=\"f\"/><geom "
                                        "size=\"0.01\"/></body><body name=\"tip\"><joint name=\"g\"/>");
  EXPECT_NE(error_of(branched).find("branch at body 'hand': choose a tip"), std::string::npos)
      << error_of(branched);
  const MjcfRobot hand = read_mjcf("arm.xml", "", "hand", &branched);
  EXPECT_EQ(hand.robot.size(), 4);
  EXPECT_FALSE(hand.not_expressed.empty());
  EXPECT_NE(error_of(arm, "nowhere").find("unknown base 'nowhere'"), std::string::npos);
  EXPECT_NE(error_of(arm, "fore", "upper").find("does not hang from"), std::string::npos);
  const std::string ball = replaced(arm, "<joint name=\"a\" axis=\"0 1 0\" pos=\"0.01 0.02 0.03\"/>",
                                    "<joint name=\"a\" type=\"ball\"/>");
  EXPECT_NE(error_of(ball).find("ball joint"), std::string::npos) << error_of(ball);
}

TEST(Mjcf, TheExportComesBack) {
  const std::string text = replaced(arm, "<joint name=\"c\" axis=\"1 1 0\" ref=\"25\"/>", "");
  const std::string single = replaced(text, "<position name=\"pc\" joint=\"c\" class=\"outer\"/>", "");
  const Robot robot = read_mjcf("arm.xml", "", "", &single).robot;
  const std::string written = to_mjcf(robot).text;
  const Robot again = read_mjcf("again.xml", "", "", &written).robot;
  ASSERT_EQ(robot.size(), 3);
  ASSERT_EQ(again.size(), robot.size());
  EXPECT_LE((again.parameters() - robot.parameters()).cwiseAbs().maxCoeff(), 1e-8);
}

/// Two joints on a body are a link without mass here, which MuJoCo has no body for: the export says so.
TEST(Mjcf, TheExportNamesALinkWithoutMass) {
  const std::string text = arm;
  const Robot robot = read_mjcf("arm.xml", "", "", &text).robot;
  const ExportText written = to_mjcf(robot);
  std::string said;
  for (const std::string& line : written.not_expressed) said += line + "\n";
  EXPECT_NE(said.find(robot.joints[2].link_name), std::string::npos) << said;
  EXPECT_THROW(read_mjcf("again.xml", "", "", &written.text), Error);
}

TEST(Mjcf, TheShippedSo101NeedsNoMeshes) {
  const char* const data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set";
  const Robot robot = read_robot(std::string(data) + "/so101_real/so101_new_calib.xml");
  ASSERT_EQ(robot.size(), 6);
  ASSERT_TRUE(robot.joints[0].servo);
  EXPECT_DOUBLE_EQ(robot.joints[0].servo->kp, 998.22);
  EXPECT_DOUBLE_EQ(robot.joints[0].servo->kd, 2.731);
  EXPECT_DOUBLE_EQ(robot.joints[5].rotor_inertia, 0.028);
}

#endif

}  // namespace
}  // namespace dynid
