// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/yaml.hpp"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "random_robot.hpp"

namespace dynid {
namespace {

using test::error_of;
using test::Random;
using test::replaced;

ModelFile random_model(Random& random) {
  ModelFile model;
  model.robot = test::random_robot(random, 6);
  for (Joint& joint : model.robot.joints) {
    joint.friction.linear.offset = test::uniform(random, -1, 1);
    joint.friction.linear.velocity_scale = test::uniform(random, 0, 0.1);
    joint.friction.sigmoid = {test::uniform(random, 0, 1), test::uniform(random, 1, 20),
                              test::uniform(random, -0.1, 0.1)};
    joint.rotor_inertia = test::uniform(random, 0, 0.1);
    joint.limits.jerk = test::uniform(random, 1, 1e4);
    joint.limits.torque_rate = 1000.0 / 3.0;
  }
  // An identified link may have nearly no mass and yet first moments, and one may be left without any
  // inertia.
  model.robot.joints[1].parameters[0] = 0.0;
  model.robot.joints[2].parameters[0] = 1e-9;
  model.robot.joints[3].parameters.setZero();
  model.robot.effects = {
      {"joint_spring",
       {1, 4},
       {{"rest", {0.1 + 0.2, 0, 0, 1.0 / 3, 0, 0}}, {"stiffness", {1.0 / 7, 0, 0, -2.0 / 3, 0, 0}}}},
      {"time_delay", {1, 2, 3, 4, 5, 6}, {{"channel_delay_s", {0, 0, 0, 0, 0, 0}}, {"delay_s", {1e-300}}}}};
  model.note = "a note: with \"quotes\", a # and\na second line";
  model.coefficients = {{"zz1", "yy2 + zz1", 0.1 + 0.2, 1.0 / 3.0, true},
                        {"fv1", "", -1e-300, std::numeric_limits<double>::infinity(), false}};
  return model;
}

void expect_same_limits(const JointLimits& a, const JointLimits& b) {
  EXPECT_EQ(a.lower, b.lower);
  EXPECT_EQ(a.upper, b.upper);
  EXPECT_EQ(a.velocity, b.velocity);
  EXPECT_EQ(a.acceleration, b.acceleration);
  EXPECT_EQ(a.jerk, b.jerk);
  EXPECT_EQ(a.torque, b.torque);
  EXPECT_EQ(a.torque_rate, b.torque_rate);
}

void expect_same_friction(const JointFriction& a, const JointFriction& b) {
  EXPECT_EQ(a.linear.viscous, b.linear.viscous);
  EXPECT_EQ(a.linear.coulomb, b.linear.coulomb);
  EXPECT_EQ(a.linear.offset, b.linear.offset);
  EXPECT_EQ(a.linear.velocity_scale, b.linear.velocity_scale);
  EXPECT_EQ(a.sigmoid.phi1, b.sigmoid.phi1);
  EXPECT_EQ(a.sigmoid.phi2, b.sigmoid.phi2);
  EXPECT_EQ(a.sigmoid.phi3, b.sigmoid.phi3);
}

/// Poses pass through angles, and link parameters through centres of mass: to rounding of their largest
/// entries.
void expect_same_joint(const Joint& a, const Joint& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.link_name, b.link_name);
  EXPECT_EQ(a.type, b.type);
  EXPECT_EQ(a.axis, b.axis);
  ASSERT_EQ(a.dh.has_value(), b.dh.has_value());
  if (a.dh) {
    EXPECT_EQ(a.origin.matrix(), b.origin.matrix());
  }
  EXPECT_LT((a.origin.matrix() - b.origin.matrix()).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(a.origin.translation(), b.origin.translation());
  EXPECT_EQ(a.parameters[0], b.parameters[0]);
  const auto close = [](const auto& x, const auto& y) {
    return (x - y).cwiseAbs().maxCoeff() <= 1e-15 * x.cwiseAbs().maxCoeff();
  };
  EXPECT_TRUE(close(a.parameters.segment<3>(1), b.parameters.segment<3>(1)));
  EXPECT_TRUE(close(a.parameters.tail<6>(), b.parameters.tail<6>()));
  EXPECT_EQ(a.rotor_inertia, b.rotor_inertia);
  expect_same_limits(a.limits, b.limits);
  expect_same_friction(a.friction, b.friction);
}

class YamlLaws : public ::testing::TestWithParam<unsigned> {};

TEST_P(YamlLaws, WhatIsWrittenIsReadAgain) {
  Random random(GetParam());
  const ModelFile a = random_model(random);
  const std::string text = to_yaml(a);
  const ModelFile b = parse_model(text, "text");
  EXPECT_EQ(a.robot.name, b.robot.name);
  EXPECT_EQ(a.robot.base_link, b.robot.base_link);
  EXPECT_EQ(a.robot.tip_link, b.robot.tip_link);
  EXPECT_EQ(a.robot.gravity, b.robot.gravity);
  EXPECT_LT((a.robot.tip.matrix() - b.robot.tip.matrix()).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(a.note, b.note);
  ASSERT_EQ(a.robot.size(), b.robot.size());
  for (std::size_t k = 0; k < a.robot.joints.size(); ++k) {
    SCOPED_TRACE(a.robot.joints[k].name);
    expect_same_joint(a.robot.joints[k], b.robot.joints[k]);
  }
  ASSERT_EQ(b.robot.effects.size(), a.robot.effects.size());
  for (std::size_t k = 0; k < a.robot.effects.size(); ++k) {
    EXPECT_EQ(a.robot.effects[k].name, b.robot.effects[k].name);
    EXPECT_EQ(a.robot.effects[k].joints, b.robot.effects[k].joints);
    EXPECT_EQ(a.robot.effects[k].parameters, b.robot.effects[k].parameters);
  }
  ASSERT_EQ(b.coefficients.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(a.coefficients[k].name, b.coefficients[k].name);
    EXPECT_EQ(a.coefficients[k].expression, b.coefficients[k].expression);
    EXPECT_EQ(a.coefficients[k].value, b.coefficients[k].value);
    EXPECT_EQ(a.coefficients[k].std_percent, b.coefficients[k].std_percent);
    EXPECT_EQ(a.coefficients[k].kept, b.coefficients[k].kept);
  }
  if (HasFailure()) std::printf("%s", text.c_str());
}

TEST_P(YamlLaws, EveryTruncationIsRefusedOrWhole) {
  Random random(GetParam());
  const std::string text = to_yaml(random_model(random));
  for (std::size_t length = 0; length < text.size(); length += 61) {
    // Whatever is cut off, the answer is a model or one line that names the file.
    const std::string error = error_of([&] { parse_model(text.substr(0, length), "cut.yaml"); });
    if (error.empty()) continue;
    EXPECT_EQ(error.rfind("cut.yaml", 0), 0U) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, YamlLaws, ::testing::Range(1U, 31U));

const char* const good = R"(format: dynid-model-1
name: two
base_link: base
tip_link: tip
tip: {xyz: [0, 0, 0.1]}
gravity: [0, 0, -9.81]
joints:
  - name: j1
    link: l1
    type: revolute
    dh: {a: 0, alpha: 0, d: 0.3}
    limits: {lower: -1, upper: 1, velocity: 2}
    mass: 1
    com: [0, 0, 0.1]
    inertia: {xx: 1, xy: 0, xz: 0, yy: 1, yz: 0, zz: 1}
  - name: j2
    link: l2
    type: prismatic
    origin: {xyz: [0, 0, 0], quaternion: [0, 0, 1, 0]}
    axis: [0, 0, 2]
    mass: 0
    first_moment: [1, 2, 3]
    inertia_about_origin: {xx: 1, xy: 2, xz: 3, yy: 4, yz: 5, zz: 6}
    friction: {viscous: 1, phi1: 1, phi2: 2, phi3: 3}
coefficients:
  - {name: zz1, value: 1}
)";

TEST(Yaml, ReadsEveryKeyWhereItBelongs) {
  const ModelFile model = parse_model(good, "good.yaml");
  const Robot& robot = model.robot;
  ASSERT_EQ(robot.size(), 2);
  EXPECT_EQ(robot.tip.translation().z(), 0.1);
  EXPECT_EQ(robot.joints[0].limits.velocity, 2);
  EXPECT_EQ(robot.joints[0].limits.torque, std::numeric_limits<double>::infinity());
  const Joint& slide = robot.joints[1];
  EXPECT_EQ(slide.type, JointType::prismatic);
  EXPECT_EQ(slide.axis, Eigen::Vector3d(0, 0, 1));
  EXPECT_LT((slide.origin.linear() * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(-1, -2, 3)).norm(), 1e-15);
  StandardParameters p;
  p << 0, 1, 2, 3, 1, 2, 4, 3, 5, 6;  // m, mx, my, mz, xx, xy, yy, xz, yz, zz
  EXPECT_EQ(slide.parameters, p);
  EXPECT_EQ(slide.friction.linear.viscous, 1);
  EXPECT_EQ(slide.friction.sigmoid.phi2, 2);
  EXPECT_TRUE(model.coefficients.at(0).kept);
  EXPECT_EQ(model.coefficients.at(0).std_percent, std::numeric_limits<double>::infinity());
}

TEST(Yaml, SaysWhetherTheModelIsPhysicallyConsistent) {
  ModelFile model = parse_model(good, "good.yaml");
  const YAML::Node bad = YAML::Load(to_yaml(model));
  EXPECT_FALSE(bad["physically_consistent"].as<bool>());
  ASSERT_EQ(bad["inconsistencies"].size(), inconsistencies(model.robot).size());
  EXPECT_EQ(bad["inconsistencies"][0].as<std::string>(), describe(inconsistencies(model.robot)[0]));
  model.robot.joints[1].parameters.setZero();
  const YAML::Node fine = YAML::Load(to_yaml(model));
  EXPECT_TRUE(fine["physically_consistent"].as<bool>());
  EXPECT_FALSE(fine["inconsistencies"]);
}

struct BadModel {
  const char* from;
  const char* to;
  const char* message;
};

TEST(Yaml, BadFilesAreNamedByLineAndKey) {
  const BadModel cases[] = {
      {"dynid-model-1", "dynid-model-2", "f:1: format: expected dynid-model-1, found 'dynid-model-2'"},
      {"format: dynid-model-1\n", "", "f:1: format: missing"},
      {"gravity: [0, 0, -9.81]\n", "", "f:1: gravity: missing"},
      {"gravity:", "gravty:", "f:6: unknown key 'gravty'"},
      {"gravity:", "name:", "f:6: key 'name' appears twice"},
      {"name: two", "name: [two]", "f:2: name: expected a text, found a list"},
      {"name: two", "name: \"\"", "f:2: name: expected a name, found an empty text"},
      {"[0, 0, -9.81]", "[0, 0]", "f:6: gravity: expected 3 numbers, found 2"},
      {"[0, 0, -9.81]", "9.81", "f:6: gravity: expected 3 numbers, found a single value"},
      {"[0, 0, -9.81]", "[0, 0, down]", "f:6: gravity[3]: expected a finite number, found 'down'"},
      {"[0, 0, -9.81]", "[0, 0, 9,81]", "f:6: gravity: expected 3 numbers, found 4"},
      {"com: [0, 0, 0.1]", "com: [0, 0, .nan]",
       "f:14: joints[1].com[3]: expected a finite number, found '.nan'"},
      {"com: [0, 0, 0.1]", "com: [0, 0, nan]",
       "f:14: joints[1].com[3]: expected a finite number, found 'nan'"},
      {"com: [0, 0, 0.1]", "com: [0, 0, 1e999]",
       "f:14: joints[1].com[3]: expected a finite number, found '1e999'"},
      {"com: [0, 0, 0.1]", "com: [0, 0]", "f:14: joints[1].com: expected 3 numbers, found 2"},
      {"    com: [0, 0, 0.1]\n", "", "f:8: joints[1].com: missing"},
      {"    mass: 1\n", "", "f:8: joints[1].mass: missing"},
      {"mass: 1", "mass: 1 kg", "f:13: joints[1].mass: expected a finite number, found '1 kg'"},
      {"mass: 1", "mass:", "f:13: joints[1].mass: expected a number, found nothing"},
      {"yz: 0, zz: 1", "zz: 1", "f:15: joints[1].inertia.yz: missing"},
      {"yz: 0, zz: 1", "yz: 0, zy: 0, zz: 1", "f:15: joints[1].inertia: unknown key 'zy'"},
      {"first_moment: [1, 2, 3]", "com: [1, 2, 3]",
       "f:16: joints[2]: takes com and inertia, or first_moment and inertia_about_origin, not both"},
      {"type: revolute", "type: ball",
       "f:10: joints[1].type: expected revolute, continuous or prismatic, found 'ball'"},
      {"dh: {a: 0,", "dh: {", "f:11: joints[1].dh.a: missing"},
      {"    dh: {a: 0, alpha: 0, d: 0.3}\n", "", "f:8: joints[1]: missing dh, or origin and axis"},
      {"axis: [0, 0, 2]", "dh: {a: 0, alpha: 0, d: 0}",
       "f:16: joints[2]: takes dh, or origin and axis, not both"},
      {"axis: [0, 0, 2]", "axis: [0, 0, 0]", "f:20: joints[2].axis: has no direction"},
      {"    axis: [0, 0, 2]\n", "", "f:16: joints[2].axis: missing"},
      {"[0, 0, 1, 0]", "[0, 0, 2, 0]", "f:19: joints[2].origin.quaternion: is not of unit length"},
      {"quaternion:", "rpy: [0, 0, 0], quaternion:",
       "f:19: joints[2].origin: takes rpy or quaternion, not both"},
      {"lower: -1", "lower: 3", "f:12: joints[1].limits: lower is above upper"},
      {"velocity: 2", "velocity: -2",
       "f:12: joints[1].limits.velocity: expected a positive number, found -2"},
      {"velocity: 2", "speed: 2", "f:12: joints[1].limits: unknown key 'speed'"},
      {"viscous: 1", "velocity_scale: -1",
       "f:24: joints[2].friction.velocity_scale: expected a number that is not negative"},
      {", phi3: 3", "", "f:24: joints[2].friction.phi3: missing"},
      {"name: j2", "name: j1", "f:16: joints[2].name: another joint is called 'j1'"},
      {"zz1, value: 1", "zz1, value: one",
       "f:26: coefficients[1].value: expected a finite number, found 'one'"},
      {"{name: zz1", "{kept: yes, name: zz1",
       "f:26: coefficients[1].kept: expected true or false, found 'yes'"},
      {"  - {name: zz1, value: 1}", "  zz1: 1", "f:26: coefficients: expected a list, found a map"},
      {"base_link: base", "base_link: [base", "f:4: end of sequence flow not found"},
      {"coefficients:", "effects: [{name: x, joints: [2, 2], parameters: {}}]\ncoefficients:",
       "f:25: effects[1].joints[2]: expected the increasing numbers of joints, 1 to 2, found 2"},
      {"coefficients:", "effects: [{name: x, joints: [3], parameters: {}}]\ncoefficients:",
       "f:25: effects[1].joints[1]: expected the increasing numbers of joints, 1 to 2, found 3"},
      {"coefficients:", "effects: [{name: x, joints: [1], parameters: {k: [y]}}]\ncoefficients:",
       "f:25: effects[1].parameters.k[1]: expected a finite number, found 'y'"},
      {"name: two", "? [a]\n: two", "f:2: a key is not a word"},
      {"coefficients:", "---\nformat:", "f:1: holds more than one document"},
  };
  for (const BadModel& bad : cases) {
    const std::string text = replaced(good, bad.from, bad.to);
    EXPECT_EQ(error_of([&] { parse_model(text, "f"); }), bad.message)
        << "'" << bad.from << "' -> '" << bad.to << "'";
  }
  const std::string no_joints = std::string(good, std::strstr(good, "joints:")) + "joints: []\n";
  EXPECT_EQ(error_of([&] { parse_model(no_joints, "f"); }), "f:7: joints: has no joint");
  EXPECT_EQ(error_of([] { parse_model("", "f"); }), "f: is empty, expected a model (format: dynid-model-1)");
  EXPECT_EQ(error_of([] { parse_model("# only a comment\n", "f"); }),
            "f: is empty, expected a model (format: dynid-model-1)");
  EXPECT_EQ(error_of([] { parse_model("t,q1,q2\n0,1,2\n", "f"); }),
            "f:1: expected a model (format: dynid-model-1)");
  EXPECT_EQ(error_of([] { read_model("no/such/file"); }),
            "no/such/file: cannot read: No such file or directory");
}

TEST(Yaml, RefusesToWriteWhatCouldNotBeReadAgain) {
  const ModelFile model = parse_model(good, "good.yaml");
  ModelFile twins = model;
  twins.robot.joints[1].name = "j1";
  EXPECT_EQ(error_of([&] { to_yaml(twins); }), "robot 'two': two joints are called 'j1'");
  ModelFile nameless = model;
  nameless.robot.joints[0].link_name.clear();
  EXPECT_EQ(error_of([&] { to_yaml(nameless); }), "robot 'two': a joint or a link has no name");
  ModelFile infinite = model;
  infinite.robot.joints[0].parameters[3] = INFINITY;
  EXPECT_EQ(error_of([&] { to_yaml(infinite); }),
            "robot 'two': joint 1 ('j1'): a parameter of link 'l1' is not finite");
  ModelFile coefficient = model;
  coefficient.coefficients[0].value = std::nan("");
  EXPECT_EQ(error_of([&] { to_yaml(coefficient); }), "coefficient 'zz1' is not finite");
}

// ------------------------------------------------------------------------------------- config/panda.yaml

TEST(Panda, IsPhysicallyConsistent) {
  const Robot panda = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  ASSERT_EQ(panda.size(), 7);
  EXPECT_TRUE(inconsistencies(panda, 0.0).empty());
  double total = 0.0;
  for (const Joint& joint : panda.joints) total += joint.parameters[0];
  EXPECT_GT(total, 16.0);  // the total mass that the letter asks for in its Section V
  EXPECT_LT(total, 20.0);
}

void expect_published_link(const Joint& joint, const YAML::Node& published) {
  const LinkInertia link = from_standard(joint.parameters);
  EXPECT_EQ(link.mass, published["mass"].as<double>());
  for (int i = 0; i < 3; ++i) {
    const YAML::Node com = published["com"][i];
    EXPECT_NEAR(link.com[i], com.IsNull() ? 0.0 : com.as<double>(), 1e-15);
  }
  const int row[] = {0, 0, 0, 1, 1, 2}, column[] = {0, 1, 2, 1, 2, 2};
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(link.inertia(row[i], column[i]), published["inertia_xx_xy_xz_yy_yz_zz"][i].as<double>(),
                1e-15);
  }
}

TEST(Panda, AgreesWithTheTables) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set: panda_published/tables.yaml";
  const YAML::Node tables = YAML::LoadFile(std::string(data) + "/panda_published/tables.yaml");
  const Robot panda = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  ASSERT_EQ(panda.size(), 7);
  EXPECT_EQ(panda.tip.translation(), Eigen::Vector3d(0, 0, tables["kinematics"]["flange_d"].as<double>()));
  for (std::size_t k = 0; k < 7; ++k) {
    SCOPED_TRACE("joint " + std::to_string(k + 1));
    const Joint& joint = panda.joints[k];
    const auto table = [&](const char* section, const char* key) {
      return tables[section][key][k].as<double>();
    };
    ASSERT_TRUE(joint.dh.has_value());
    EXPECT_EQ(joint.dh->a, table("kinematics", "a"));
    EXPECT_EQ(joint.dh->alpha, table("kinematics", "alpha"));
    EXPECT_EQ(joint.dh->d, table("kinematics", "d"));
    EXPECT_EQ(joint.dh->theta, 0.0);
    EXPECT_EQ(joint.limits.lower, table("limits", "lower"));
    EXPECT_EQ(joint.limits.upper, table("limits", "upper"));
    EXPECT_EQ(joint.limits.velocity, table("limits", "velocity"));
    EXPECT_EQ(joint.limits.acceleration, table("limits", "acceleration"));
    EXPECT_EQ(joint.limits.jerk, table("limits", "jerk"));
    EXPECT_EQ(joint.limits.torque, table("limits", "torque"));
    EXPECT_EQ(joint.limits.torque_rate, table("limits", "torque_rate"));
    EXPECT_EQ(joint.friction.sigmoid.phi1, table("joint_friction", "phi1"));
    EXPECT_EQ(joint.friction.sigmoid.phi2, table("joint_friction", "phi2"));
    EXPECT_EQ(joint.friction.sigmoid.phi3, table("joint_friction", "phi3"));
    expect_published_link(joint, tables["retrieval"]["links"][k]);
  }
}

}  // namespace
}  // namespace dynid
