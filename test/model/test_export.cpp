// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/export.hpp"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>

#ifdef DYNID_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif
#ifdef DYNID_HAVE_SDFORMAT
#include <sdf/Frame.hh>
#include <sdf/Joint.hh>
#include <sdf/JointAxis.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#endif

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"
#include "random_robot.hpp"

namespace dynid {
namespace {

using test::error_of;
using test::Random;
using test::uniform;

Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

struct State {
  Eigen::VectorXd q, dq, ddq;
};

/// Positions within the limits; every joint moves at 1 to 2 rad/s.
[[maybe_unused]] State random_state(Random& random, const Robot& robot) {
  const int n = robot.size();
  State s{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (int k = 0; k < n; ++k) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(k)].limits;
    s.q[k] = uniform(random, std::max(-3.0, limits.lower), std::min(3.0, limits.upper));
    s.dq[k] = uniform(random, 1.0, 2.0) * (random() % 2 == 0 ? 1.0 : -1.0);
    s.ddq[k] = uniform(random, -5.0, 5.0);
  }
  return s;
}

/// Rigid body, eq. (24) and rotor inertia.
[[maybe_unused]] Eigen::VectorXd torque(const Robot& robot, const State& s) {
  const Model<> model(robot);
  Workspace<> ws(model);
  Eigen::VectorXd tau(robot.size());
  inverse_dynamics(model, ws, s.q, s.dq, s.ddq, tau);
  for (int k = 0; k < robot.size(); ++k) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(k)];
    tau[k] += friction_torque(joint.friction.linear, s.dq[k]) + joint.rotor_inertia * s.ddq[k];
  }
  return tau;
}

bool lists(const ExportText& text, const std::string& words) {
  return std::any_of(text.not_expressed.begin(), text.not_expressed.end(),
                     [&](const std::string& line) { return line.find(words) != std::string::npos; });
}

/// Plates: on the border of eq. (16), where rounding decides.
LinkInertia random_plate(Random& random) {
  LinkInertia link = test::random_link(random);
  const double a = uniform(random, 0.001, 0.1), b = uniform(random, 0.001, 0.1);
  const Eigen::Matrix3d R = test::random_rotation(random);
  link.inertia = R * Eigen::Vector3d(a, b, a + b).asDiagonal() * R.transpose();
  link.inertia = (0.5 * (link.inertia + link.inertia.transpose())).eval();
  return link;
}

/// One link: of any principal moments, a plate, or without mass.
[[maybe_unused]] Robot with_a_body_that_may_not_exist(unsigned seed) {
  Random random(seed);
  Robot robot = test::random_robot(random, 1);
  LinkInertia body = random_plate(random);
  if (seed % 3 != 0) {
    const Eigen::Matrix3d R = test::random_rotation(random);
    const Eigen::Vector3d m(uniform(random, -0.05, 0.3), uniform(random, 0, 0.3), uniform(random, 0, 0.3));
    body.inertia = R * m.asDiagonal() * R.transpose();
    body.inertia = (0.5 * (body.inertia + body.inertia.transpose())).eval();
  }
  robot.joints[0].parameters = to_standard(body);
  if (seed == 0) robot.joints[0].parameters.setZero();
  return robot;
}

/// Everything that neither format has a word for, on joint 1.
Robot with_all_there_is(Random& random) {
  Robot robot = test::random_robot(random, 3);
  Joint& joint = robot.joints[0];
  joint.friction.linear = {0.3, 0.2, 0.1, 0.01};
  joint.friction.sigmoid = {0.5, 4.0, 0.02};
  joint.limits.acceleration = 10.0;
  joint.limits.jerk = 100.0;
  joint.limits.torque_rate = 1000.0;
  return robot;
}

void expect_common_list(const ExportText& text) {
  for (const char* words : {"smoothing of Coulomb friction below 0.01", "friction offset 0.1",
                            "sigmoid friction phi1 0.5, phi2 4, phi3 0.02", "acceleration limit 10",
                            "jerk limit 100", "torque rate limit 1000"}) {
    EXPECT_TRUE(lists(text, std::string("joint 'joint1': ") + words)) << words;
  }
}

TEST(Export, NamesThatCannotBeAreRefused) {
  Random random(1);
  for (const auto& write : {to_mjcf, to_sdf}) {
    Robot robot = test::random_robot(random, 3);
    robot.joints[2].name = robot.joints[0].name;
    EXPECT_EQ(error_of([&] { write(robot); }), "robot 'random': two joints are called 'joint1'");
    robot = test::random_robot(random, 3);
    robot.joints[2].link_name = robot.base_link;
    EXPECT_EQ(error_of([&] { write(robot); }), "robot 'random': two links are called 'base'");
    robot.joints[2].link_name = "world";
    EXPECT_NE(error_of([&] { write(robot); }), "");
    robot.joints.clear();
    EXPECT_NE(error_of([&] { write(robot); }), "");
  }
}

// What a patch adds is not lost silently.
TEST(Export, EffectsAreListedWhereTheyCannotBeSaid) {
  Random random(8);
  Robot robot = test::random_robot(random, 3);
  robot.effects = {{"joint_spring", {1, 3}, {{"stiffness", {2.0, 0.0, 3.0}}, {"rest", {0.1, 0.0, -0.2}}}},
                   {"time_delay", {}, {{"delay", {0.002}}}}};
  const auto expect_lists = [](const std::vector<std::string>& list, bool spring) {
    const auto has = [&](const char* line) { return std::count(list.begin(), list.end(), line); };
    EXPECT_EQ(has("effect 'joint_spring' of joint 1, 3"), spring ? 1 : 0);
    EXPECT_EQ(has("effect 'time_delay'"), 1);
  };
  expect_lists(to_mjcf(robot).not_expressed, false);
  expect_lists(to_sdf(robot).not_expressed, true);
  expect_lists(to_franka_inertials(robot).not_expressed, true);
  expect_lists(to_header(robot).not_expressed, true);
  const UrdfText urdf = to_urdf(robot);
  expect_lists(urdf.not_expressed, true);
  expect_lists(update_urdf(urdf.text, "r.urdf", robot).not_expressed, true);
  robot.effects[0].parameters["stiffness"][2] = -3.0;
  EXPECT_TRUE(lists(to_mjcf(robot), "joint 'joint3': spring of stiffness -3 N m/rad"));
}

// ---------------------------------------------------------------------------------------------- MJCF

TEST(ExportMjcf, WhatItCannotSayIsListed) {
  Random random(2);
  Robot robot = with_all_there_is(random);
  robot.joints[0].limits.velocity = 2.5;
  robot.joints[1].limits.lower = robot.joints[1].limits.upper = 0.5;
  robot.joints[1].friction.linear.coulomb = -1.0;
  robot.joints[1].rotor_inertia = -2.0;
  const ExportText mjcf = to_mjcf(robot);
  expect_common_list(mjcf);
  EXPECT_TRUE(lists(mjcf, "joint 'joint1': velocity limit 2.5"));
  EXPECT_TRUE(lists(mjcf, "joint 'joint2': position limits that are both 0.5"));
  EXPECT_TRUE(lists(mjcf, "joint 'joint2': negative Coulomb friction -1"));
  EXPECT_TRUE(lists(mjcf, "joint 'joint2': negative rotor inertia -2"));
}

#ifdef DYNID_HAVE_MUJOCO

using MujocoModel = std::unique_ptr<mjModel, void (*)(mjModel*)>;

MujocoModel load(const std::string& text, std::string* refusal = nullptr) {
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  mj_makeEmptyFileVFS(vfs.get(), "robot.xml", static_cast<int>(text.size()));
  std::copy(text.begin(), text.end(), static_cast<char*>(vfs->filedata[0]));
  char error[1000] = "";
  MujocoModel model(mj_loadXML("robot.xml", vfs.get(), error, sizeof(error)), &mj_deleteModel);
  mj_deleteVFS(vfs.get());
  if (refusal != nullptr) {
    *refusal = error;
  } else if (!model) {
    ADD_FAILURE() << error << "\n" << text;
  }
  return model;
}

/// MuJoCo's torques are torque()'s, and its site is the tip.
void expect_same_torques(Random& random, const Robot& robot, int states) {
  const std::string text = to_mjcf(robot).text;
  const MujocoModel m = load(text);
  ASSERT_TRUE(m);
  const int n = robot.size();
  ASSERT_EQ(m->nv, n);
  ASSERT_EQ(m->nsite, 1);
  const std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), &mj_deleteData);
  for (int k = 0; k < states; ++k) {
    const State s = random_state(random, robot);
    Eigen::Map<Eigen::VectorXd>(d->qpos, n) = s.q;
    Eigen::Map<Eigen::VectorXd>(d->qvel, n) = s.dq;
    Eigen::Map<Eigen::VectorXd>(d->qacc, n) = s.ddq;
    mj_inverse(m.get(), d.get());
    const Eigen::VectorXd expected = torque(robot, s);
    const Eigen::VectorXd found = Eigen::Map<Eigen::VectorXd>(d->qfrc_inverse, n);
    ASSERT_LE((found - expected).norm(), 1e-9 * expected.norm()) << "state " << k << "\n" << text;
    const Eigen::Isometry3d tip = test::link_poses(robot, s.q).back();
    ASSERT_LE((Eigen::Map<Eigen::Vector3d>(d->site_xpos) - tip.translation()).norm(), 1e-12);
    const Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(d->site_xmat);
    ASSERT_LE((R - tip.linear()).norm(), 1e-12);
  }
}

TEST(ExportMjcf, MujocoHasTheTorquesOfThePanda) {
  Random random(3);
  Robot robot = panda();
  expect_same_torques(random, robot, 200);
  for (Joint& joint : robot.joints) {
    joint.friction.linear.viscous = uniform(random, 0, 1);
    joint.rotor_inertia = uniform(random, 0, 0.5);
  }
  expect_same_torques(random, robot, 200);
  // MuJoCo's dry friction is a soft constraint: away from rest, at rotors as heavy as these, it is Coulomb's.
  for (Joint& joint : robot.joints) joint.friction.linear.coulomb = uniform(random, 0, 1);
  for (Joint& joint : robot.joints) joint.rotor_inertia += 0.1;
  expect_same_torques(random, robot, 200);
}

TEST(ExportMjcf, MujocoHasTheTorquesOfRandomRobots) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Robot robot = test::random_robot(random, 2 + static_cast<int>(seed % 7));
    for (Joint& joint : robot.joints) {
      joint.friction.linear.coulomb = 0.0;
      joint.rotor_inertia = seed % 2 == 0 ? 0.0 : uniform(random, 0, 0.2);
      if (seed % 5 == 0) joint.parameters = to_standard(random_plate(random));
    }
    if (seed % 3 == 0) robot.base_link = "world";
    expect_same_torques(random, robot, 20);
    if (HasFailure()) return;
  }
}

TEST(ExportMjcf, MujocoHasTheLimitsFrictionAndRotorInertia) {
  Random random(4);
  Robot robot = test::random_robot(random, 6);
  robot.name = "a <b> & \"c\"";
  for (Joint& joint : robot.joints) joint.rotor_inertia = uniform(random, 0, 1);
  const MujocoModel m = load(to_mjcf(robot).text);
  ASSERT_TRUE(m);
  for (int k = 0; k < 6; ++k) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(k)];
    EXPECT_EQ(mj_name2id(m.get(), mjOBJ_JOINT, joint.name.c_str()), k);
    EXPECT_EQ(mj_name2id(m.get(), mjOBJ_BODY, joint.link_name.c_str()), k + 2);  // after world and base
    EXPECT_EQ(m->jnt_type[k], joint.type == JointType::prismatic ? mjJNT_SLIDE : mjJNT_HINGE);
    EXPECT_EQ(m->jnt_limited[k] != 0, joint.type != JointType::continuous);
    if (m->jnt_limited[k]) {
      EXPECT_EQ(m->jnt_range[2 * k], joint.limits.lower);
      EXPECT_EQ(m->jnt_range[2 * k + 1], joint.limits.upper);
    }
    EXPECT_EQ(m->dof_damping[k], joint.friction.linear.viscous);
    EXPECT_EQ(m->dof_frictionloss[k], joint.friction.linear.coulomb);
    EXPECT_EQ(m->dof_armature[k], joint.rotor_inertia);
    EXPECT_EQ(m->actuator_trnid[2 * k], k);
    EXPECT_EQ(m->actuator_ctrllimited[k] != 0, std::isfinite(joint.limits.torque));
    if (m->actuator_ctrllimited[k]) {
      EXPECT_EQ(m->actuator_ctrlrange[2 * k + 1], joint.limits.torque);
    }
  }
}

TEST(ExportMjcf, MujocoHasTheSprings) {
  Random random(9);
  Robot robot = test::random_robot(random, 3);
  for (Joint& joint : robot.joints) joint.friction.linear.coulomb = 0.0;
  const Eigen::Vector3d k(2.0, 0.0, 3.0), rest(0.1, 0.0, -0.2);
  // Two in parallel are as one between them.
  robot.effects = {{"joint_spring", {1, 3}, {{"stiffness", {2.0, 0.0, 1.0}}, {"rest", {0.1, 0.0, -0.4}}}},
                   {"joint_spring", {3}, {{"stiffness", {0.0, 0.0, 2.0}}, {"rest", {0.0, 0.0, -0.1}}}}};
  const MujocoModel m = load(to_mjcf(robot).text);
  ASSERT_TRUE(m);
  const std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), &mj_deleteData);
  for (int state = 0; state < 20; ++state) {
    const State s = random_state(random, robot);
    Eigen::Map<Eigen::VectorXd>(d->qpos, 3) = s.q;
    Eigen::Map<Eigen::VectorXd>(d->qvel, 3) = s.dq;
    Eigen::Map<Eigen::VectorXd>(d->qacc, 3) = s.ddq;
    mj_inverse(m.get(), d.get());
    const Eigen::Vector3d expected = torque(robot, s) + k.cwiseProduct(s.q - rest);
    const Eigen::Vector3d found = Eigen::Map<Eigen::VectorXd>(d->qfrc_inverse, 3);
    EXPECT_LE((found - expected).norm(), 1e-9 * expected.norm()) << "state " << state;
  }
}

TEST(ExportMjcf, ABodyIsListedExactlyWhereMujocoRefusesIt) {
  int refused = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const Robot robot = with_a_body_that_may_not_exist(seed);
    const ExportText mjcf = to_mjcf(robot);
    std::string why;
    const bool loaded = load(mjcf.text, &why) != nullptr;
    refused += loaded ? 0 : 1;
    EXPECT_EQ(lists(mjcf, "which MuJoCo refuses"), !loaded) << "seed " << seed << ": " << why << "\n"
                                                            << mjcf.text;
  }
  EXPECT_GT(refused, 10);
  EXPECT_LT(refused, 90);
}

#else

TEST(ExportMjcf, MujocoHasTheTorques) { GTEST_SKIP() << "built without MuJoCo"; }

#endif

// ----------------------------------------------------------------------------------------------- SDF

TEST(ExportSdf, WhatItCannotSayIsListed) {
  Random random(5);
  Robot robot = with_all_there_is(random);
  robot.joints[0].rotor_inertia = 0.25;
  robot.joints[1].name = robot.joints[1].link_name;
  robot.joints[2].parameters = -StandardParameters::Unit(0);
  robot.gravity = Eigen::Vector3d(0, 1, -9);
  const ExportText sdf = to_sdf(robot);
  expect_common_list(sdf);
  EXPECT_TRUE(lists(sdf, "joint 'joint1': rotor inertia 0.25 kg m^2"));
  EXPECT_TRUE(lists(sdf, "joint 'link2': its name, which is taken: it is 'link2_joint' there"));
  EXPECT_TRUE(lists(sdf, "link 'link3': mass -1 kg"));
  EXPECT_TRUE(lists(sdf, "gravity 0 1 -9 m/s^2 in the base frame"));
}

#ifdef DYNID_HAVE_SDFORMAT

Eigen::Vector3d eigen(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }

Eigen::Isometry3d eigen(const ignition::math::Pose3d& pose) {
  const auto& q = pose.Rot();
  Eigen::Isometry3d T(Eigen::Quaterniond(q.W(), q.X(), q.Y(), q.Z()));
  T.translation() = eigen(pose.Pos());
  return T;
}

Eigen::Isometry3d resolved(const sdf::SemanticPose& pose, const std::string& frame) {
  ignition::math::Pose3d out;
  const sdf::Errors errors = pose.Resolve(out, frame);
  for (const sdf::Error& error : errors) ADD_FAILURE() << error.Message();
  return eigen(out);
}

/// The robot that libsdformat finds in a text: the moving joints in their order.
Robot read_sdf(const std::string& text, Eigen::Vector3d gravity) {
  sdf::Root root;
  const sdf::Errors errors = root.LoadSdfString(text);
  for (const sdf::Error& error : errors) ADD_FAILURE() << error.Message();
  const sdf::Model* model = root.Model();
  if (model == nullptr) throw Error("no model");
  Robot robot;
  robot.name = model->Name();
  robot.gravity = gravity;
  for (uint64_t k = 0; k < model->JointCount(); ++k) {
    const sdf::Joint& source = *model->JointByIndex(k);
    const std::string parent = source.ParentLinkName();
    if (source.Type() == sdf::JointType::FIXED) {
      EXPECT_EQ(parent, "world");
      continue;
    }
    const sdf::Link& link = *model->LinkByName(source.ChildLinkName());
    const sdf::JointAxis& axis = *source.Axis();
    Joint joint;
    joint.name = source.Name();
    joint.link_name = link.Name();
    joint.type = source.Type() == sdf::JointType::PRISMATIC    ? JointType::prismatic
                 : source.Type() == sdf::JointType::CONTINUOUS ? JointType::continuous
                                                               : JointType::revolute;
    joint.origin = resolved(link.SemanticPose(), parent == "world" ? "__model__" : parent);
    ignition::math::Vector3d xyz;
    EXPECT_TRUE(axis.ResolveXyz(xyz, link.Name()).empty());
    joint.axis = eigen(xyz);
    joint.limits.lower = axis.Lower();
    joint.limits.upper = axis.Upper();
    joint.limits.velocity = axis.MaxVelocity();
    joint.limits.torque = axis.Effort();
    joint.friction.linear.viscous = axis.Damping();
    joint.friction.linear.coulomb = axis.Friction();
    const ignition::math::Inertiald& inertial = link.Inertial();
    LinkInertia body;
    body.mass = inertial.MassMatrix().Mass();
    body.com = eigen(inertial.Pose().Pos());
    const ignition::math::Matrix3d I = inertial.Moi();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) body.inertia(r, c) = I(static_cast<size_t>(r), static_cast<size_t>(c));
    }
    joint.parameters = to_standard(body);
    robot.joints.push_back(joint);
  }
  if (model->FrameCount() == 1) {
    const sdf::Frame& frame = *model->FrameByIndex(0);
    robot.tip_link = frame.Name();
    robot.tip = resolved(frame.SemanticPose(), robot.joints.back().link_name);
  }
  return robot;
}

void expect_same_robot(Random& random, const Robot& robot) {
  const ExportText sdf = to_sdf(robot);
  const Robot back = read_sdf(sdf.text, robot.gravity);
  ASSERT_EQ(back.size(), robot.size());
  EXPECT_EQ(back.name, robot.name);
  EXPECT_EQ(back.tip_link, robot.tip_link);
  EXPECT_LE((back.tip.matrix() - robot.tip.matrix()).norm(), 1e-13);
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const Joint &a = robot.joints[k], &b = back.joints[k];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.link_name, b.link_name);
    EXPECT_EQ(a.type, b.type);
    EXPECT_EQ(a.friction.linear.viscous, b.friction.linear.viscous);
    EXPECT_EQ(a.friction.linear.coulomb, b.friction.linear.coulomb);
    const auto expect_limit = [](double ours, double theirs) {
      const bool none = std::isinf(ours) && std::abs(theirs) >= 1e16 && ours * theirs > 0.0;
      EXPECT_TRUE(none || ours == theirs) << ours << ", in SDF " << theirs;
    };
    expect_limit(a.limits.lower, b.limits.lower);
    expect_limit(a.limits.upper, b.limits.upper);
    expect_limit(a.limits.velocity, b.limits.velocity);
    expect_limit(a.limits.torque, b.limits.torque);
  }
  for (int k = 0; k < 20; ++k) {
    const State s = random_state(random, robot);
    Robot ours = robot;  // without what SDF has no word for
    for (Joint& joint : ours.joints) joint.rotor_inertia = 0.0;
    const Eigen::VectorXd expected = torque(ours, s);
    ASSERT_LE((torque(back, s) - expected).norm(), 1e-11 * expected.norm()) << "state " << k;
  }
}

TEST(ExportSdf, LibsdformatHasTheTorquesOfThePanda) {
  Random random(6);
  expect_same_robot(random, panda());
}

TEST(ExportSdf, LibsdformatHasTheTorquesOfRandomRobots) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Robot robot = test::random_robot(random, 1 + static_cast<int>(seed % 8));
    if (seed % 3 == 0) robot.base_link = "world";
    if (seed % 4 == 0) robot.name = "a <b> & c";
    if (seed % 5 == 0) robot.joints[0].name = robot.base_link + "_to_world";
    expect_same_robot(random, robot);
    if (HasFailure()) return;
  }
}

TEST(ExportSdf, ABodyIsListedExactlyWhereLibsdformatRefusesIt) {
  int refused = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const ExportText text = to_sdf(with_a_body_that_may_not_exist(seed));
    sdf::Root root;
    const sdf::Errors errors = root.LoadSdfString(text.text);
    refused += errors.empty() ? 0 : 1;
    EXPECT_EQ(lists(text, "which libsdformat refuses"), !errors.empty()) << "seed " << seed << "\n"
                                                                         << text.text;
  }
  EXPECT_GT(refused, 10);
  EXPECT_LT(refused, 90);
}

TEST(ExportSdf, AJointCalledAsALinkIsRenamed) {
  Random random(7);
  Robot robot = test::random_robot(random, 2);
  robot.joints[0].name = "link2";
  const Robot back = read_sdf(to_sdf(robot).text, robot.gravity);
  EXPECT_EQ(back.joints[0].name, "link2_joint");
}

#else

TEST(ExportSdf, LibsdformatHasTheTorques) { GTEST_SKIP() << "built without libsdformat"; }

#endif

// -------------------------------------------------------------------------- inertials of franka_description

TEST(ExportFranka, YamlHasTheInertia) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Random random(seed);
    Robot robot = seed == 0 ? panda() : test::random_robot(random, 7);
    if (seed == 1) {  // numbers with an exponent
      robot.joints[0].parameters = to_standard({1.0, {1e-7, 0, 0}, 1e-5 * Eigen::Matrix3d::Identity()});
    }
    const ExportText franka = to_franka_inertials(robot);
    EXPECT_EQ(franka.not_expressed.size(), 1u);
    const YAML::Node file = YAML::Load(franka.text);
    ASSERT_EQ(file.size(), 7u);
    for (int k = 0; k < 7; ++k) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", link " + std::to_string(k + 1));
      const LinkInertia body = from_standard(robot.joints[static_cast<std::size_t>(k)].parameters);
      const YAML::Node link = file["link" + std::to_string(k + 1)];
      ASSERT_TRUE(link);
      EXPECT_EQ(link["mass"].as<double>(), body.mass);
      EXPECT_EQ(link["origin"]["rpy"].as<std::string>(), "0 0 0");
      std::istringstream xyz(link["origin"]["xyz"].as<std::string>());
      for (int i = 0; i < 3; ++i) {
        double value = NAN;
        xyz >> value;
        EXPECT_EQ(value, body.com[i]);
      }
      const char* const names[3][3] = {{"xx", "xy", "xz"}, {"xy", "yy", "yz"}, {"xz", "yz", "zz"}};
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
          const YAML::Node value = link["inertia"][names[r][c]];
          EXPECT_NEAR(value.as<double>(), body.inertia(r, c), 1e-15);
          // YAML 1.1 takes 1e-05 for a text.
          const std::string text = value.Scalar();
          EXPECT_TRUE(text.find('e') == std::string::npos || text.find('.') < text.find('e')) << text;
        }
      }
    }
  }
}

}  // namespace
}  // namespace dynid
