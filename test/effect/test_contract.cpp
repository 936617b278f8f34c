// SPDX-License-Identifier: Apache-2.0
// The contract of the catalogue: every effect, written by one, is read by all: the schema, the plant, a model
// file, the torque along a log, the loop, the exports, the report.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "contract.hpp"
#include "dynid/app/report.hpp"
#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/estimation/torque_model.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/simulation/plant.hpp"

namespace dynid {
namespace {

using namespace test;

class Contract : public EffectOnRobot {};

TEST_P(Contract, TheSchemaTakesWhatIsRightAndNamesWhatIsNot) {
  for (const Effect& effect : cases_) {
    // Law: what is complete stays as it is.
    EXPECT_EQ(complete_effect(effect, robot_).parameters, effect.parameters);
    EXPECT_EQ(checked_effect(effect, robot_).parameters, effect.parameters);
    EXPECT_EQ(checked_effect(effect, robot_).joints, effect.joints);
    // Law: the parts of an effect are the effect.
    std::size_t joints = 0;
    for (const Effect& part : split_forms(effect, robot_)) joints += part.joints.size();
    EXPECT_EQ(joints, effect.joints.size());
  }
  const auto refuses = [&](const Effect& effect, const std::string& word) {
    const std::string what = error_of([&] { checked_effect(effect, robot_); });
    EXPECT_NE(what.find("effect '" + schema_.name + "'"), std::string::npos) << what;
    EXPECT_NE(what.find(word), std::string::npos) << what << " does not say " << word;
  };
  Effect wrong = cases_[0];
  wrong.parameters["rust"] = {1.0};
  refuses(wrong, "'rust'");
  wrong = cases_[0];
  wrong.joints = {robot_.size() + 1};
  refuses(wrong, "joint");
  for (const EffectParameter& p : schema_.parameters) {
    if (cases_[0].parameters.count(p.key) == 0) continue;
    wrong = cases_[0];
    wrong.parameters[p.key].resize(wrong.parameters[p.key].size() + 2, 1.0);
    refuses(wrong, p.key);
    wrong = cases_[0];
    wrong.parameters[p.key].assign(wrong.parameters[p.key].size(), std::nan(""));
    refuses(wrong, p.key);
    // One number is for every joint that the effect has.
    if (!p.per_joint) continue;
    wrong = cases_[0];
    wrong.parameters[p.key] = {cases_[0].parameters.at(p.key)[static_cast<std::size_t>(wrong.joints[0] - 1)]};
    EXPECT_EQ(checked_effect(wrong, robot_).parameters, cases_[0].parameters) << p.key;
  }
}

TEST_P(Contract, ThePlantHasIt) {
  for (const Effect& effect : cases_) {
    const SimulatedRun simulated = run(robot_, {effect});
    ASSERT_EQ(simulated.injected.size(), 1U);
    EXPECT_TRUE(simulated.seen_tau.allFinite());
    if (any_of(effect, "command_limit")) continue;  // beyond what is asked for here: the robot would fall
    EXPECT_GT(simulated.injected[0].norm() / std::sqrt(double(simulated.injected[0].size())), 1e-4);
  }
}

TEST_P(Contract, AModelFileCarriesIt) {
  for (const Effect& effect : cases_) {
    ModelFile model;
    model.robot = with(robot_, effect);
    const std::string text = to_yaml(model);
    const Robot back = parse_model(text, "m.yaml").robot;
    ASSERT_EQ(back.effects.size(), 1U);
    EXPECT_EQ(back.effects[0].name, effect.name);
    EXPECT_EQ(back.effects[0].joints, effect.joints);
    EXPECT_EQ(back.effects[0].parameters, effect.parameters);
    // A key that is not the effect's is refused by file and key.
    std::string bad = text;
    bad.replace(bad.find("    parameters:"), 15, "    parameters:\n      rust: [1]");
    const std::string what = error_of([&] { parse_model(bad, "m.yaml"); });
    EXPECT_EQ(what.rfind("m.yaml:", 0), 0U) << what;
    EXPECT_NE(what.find("'rust'"), std::string::npos) << what;
  }
}

// Law: what the loop can compute is, along a log of a plant that has it, the plant's torque to rounding, and
// the loop's torque is that of `dynid torque`. (The plant's laws are other code than the model's.)
TEST_P(Contract, TheTorqueAlongALogIsThatOfThePlant) {
  for (const Effect& effect : cases_) {
    const Log log = seen(run(robot_, {effect}));
    const Robot model = with(robot_, effect);
    const Eigen::MatrixXd tau = predicted(model, log);
    ASSERT_TRUE(tau.allFinite());
    const double before = (predicted(robot_, log) - log.tau).norm(), after = (tau - log.tau).norm();
    if (any_of(effect, "command_limit")) continue;
    ASSERT_GT(before, 0.0);
    if (schema_.in_loop()) {
      EXPECT_LT((tau - log.tau).cwiseAbs().maxCoeff(), 1e-6) << before;
    } else if (!harder(effect)) {
      EXPECT_LT(after, 0.7 * before) << before;
    }
  }
}

TEST_P(Contract, AnExportSaysItOrListsIt) {
  for (const Effect& effect : cases_) {
    const Robot model = with(robot_, effect);
    // Where a line lists it, the rest is the plain robot's.
    const auto but = [&](std::vector<std::string> list) {
      list.erase(std::remove_if(list.begin(), list.end(),
                                [&](const std::string& line) {
                                  return line.rfind("effect '" + effect.name + "'", 0) == 0;
                                }),
                 list.end());
      return list;
    };
    const auto check = [&](const auto& a, const auto& b) {
      const bool listed = but(a.not_expressed).size() < a.not_expressed.size();
      const bool said = a.text != b.text || but(a.not_expressed) != b.not_expressed;
      EXPECT_NE(listed, said) << effect.name << (listed ? ": listed and said" : ": lost");
    };
    check(to_mjcf(model), to_mjcf(robot_));
    check(to_sdf(model), to_sdf(robot_));
    check(to_urdf(model), to_urdf(robot_));
    check(to_header(model), to_header(robot_));
  }
}

TEST_P(Contract, TheDiagnosisWritesAndReportsItsWords) {
  for (const auto& h : hypotheses()) {
    if (h->name() != schema_.name) continue;
    SCOPED_TRACE(h->form());
    const int unit = h->units(robot_) - 1;
    Eigen::VectorXd shape(static_cast<Eigen::Index>(h->shape().size()));
    for (Eigen::Index k = 0; k < shape.size(); ++k) {
      const ShapeParameter p = h->shape()[static_cast<std::size_t>(k)];
      shape[k] = h->scope() == Scope::window ? 0.1 + 0.1 * double(k) : p.low + 0.7 * (p.high - p.low);
    }
    Eigen::VectorXd c = Eigen::VectorXd::Constant(10, 0.3);
    if (h->name() == "payload" || h->name() == "link_inertial_error")
      c = to_standard({0.5, {0.02, 0.01, 0.03}, 0.004 * Eigen::Matrix3d::Identity()});
    if (h->scope() == Scope::window) c = Eigen::VectorXd::Constant(3, 0.3);
    FoundEffect found;
    found.effect.name = h->name();
    found.effect.joints = h->joints(robot_, unit);
    for (const NamedValue& v : h->parameters(robot_, unit, c, shape)) {
      const EffectParameter& p = schema_.parameter(v.key);  // its words are the schema's
      EXPECT_EQ(v.per_joint, p.per_joint) << v.key;
      EXPECT_EQ(v.unit,
                schema_.unit(v.key, robot_, h->scope() == Scope::pair ? found.effect.joints[0] - 1 : unit))
          << v.key;
      Eigen::VectorXd value = v.value;
      if (v.per_joint) {
        value = Eigen::VectorXd::Zero(robot_.size());
        value[unit] = v.value[0];
      } else {
        EXPECT_EQ(static_cast<std::size_t>(value.size()), p.initial.size()) << v.key;
      }
      found.effect.parameters[v.key].assign(value.data(), value.data() + value.size());
      found.parameters.push_back({v.key, v.unit, value, value, value, v.per_joint});
    }
    // The patch is read by file, plant and torque, whatever entered the robot.
    ModelFile file;
    file.robot = patched(robot_, {found});
    const Robot back = parse_model(to_yaml(file), "patch.yaml").robot;
    ASSERT_EQ(back.effects.size(), file.robot.effects.size());
    const bool early = h->name() == "time_delay" && shape[0] < 0.0;
    if (!early) {
      EXPECT_NO_THROW(Plant{back});
    }
    EXPECT_EQ(error_of([&] { TorqueModel<> loop(back); }).empty(), schema_.in_loop());
    const Log log = seen(run(robot_, {}));
    EXPECT_TRUE(predicted(back, log).allFinite());
    // The report shows name, unit and one row for a joint.
    Diagnosis d;
    d.verdict = Verdict::explained;
    const Eigen::VectorXd one = Eigen::VectorXd::Ones(robot_.size());
    d.rms = one, d.floor = 0.1 * one, d.shrink = {one, 0.1 * one, 0.1 * one, 0.9, 0.8, 1.0, true};
    d.effects = {found};
    d.ranking = {{h->name(), 0.9}};
    d.series.t = Eigen::VectorXd::LinSpaced(20, 0.0, 1.0);
    d.series.before = d.series.after = Eigen::MatrixXd::Constant(20, robot_.size(), 0.1);
    d.series.log.assign(20, 0);
    d.series.held_out.assign(20, 1);
    d.logs.resize(1);
    const std::string html = to_html(d, {});
    std::string words = h->name();
    std::replace(words.begin(), words.end(), '_', ' ');
    EXPECT_NE(html.find(words), std::string::npos);
    for (const ParameterEstimate& p : found.parameters) {
      std::string label = p.key;
      std::replace(label.begin(), label.end(), '_', ' ');
      EXPECT_NE(html.find(label), std::string::npos) << label;
      std::string unit_text = p.unit == "1" ? "" : "[" + p.unit + "]";
      if (const std::size_t square = unit_text.find("^2"); square != std::string::npos)
        unit_text.replace(square, 2, "\u00b2");
      EXPECT_NE(html.find(unit_text), std::string::npos) << unit_text;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Contract, ::testing::ValuesIn(all_cases()), case_name);

TEST(Effect, UnitsGoWithTheJointType) {
  EXPECT_EQ(unit_of("N m", JointType::prismatic), "N");
  EXPECT_EQ(unit_of("N m s/rad", JointType::prismatic), "N s/m");
  EXPECT_EQ(unit_of("kg m^2", JointType::prismatic), "kg");
  EXPECT_EQ(unit_of("N m", JointType::continuous), "N m");
  EXPECT_EQ(unit_of("s", JointType::prismatic), "s");
}

// Law: of an effect whose joints have two forms, each joint is read by its own.
TEST(Effect, JointsOfTwoFormsAreEachReadByItsOwn) {
  const Robot robot = robot_of("panda");
  const Effect both = parse_effect("torque_saturation:joints=1+2,limit=20:30,command_limit=0:12", robot);
  const std::vector<Effect> parts = split_forms(both, robot);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].joints, std::vector<int>{1});
  EXPECT_EQ(parts[0].parameters.at("limit"), (std::vector<double>{20, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(parts[0].parameters.count("command_limit"), 0U);
  EXPECT_EQ(parts[1].joints, std::vector<int>{2});
  EXPECT_EQ(parts[1].parameters.at("command_limit"), (std::vector<double>{0, 12, 0, 0, 0, 0, 0}));
  const std::vector<Effect> late =
      split_forms(parse_effect("time_delay:joints=3,delay_s=0.02", robot), robot);
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0].parameters.at("channel_delay_s"), (std::vector<double>{0, 0, 0.02, 0, 0, 0, 0}));
}

TEST(Effect, WhatAFileLeavesOutIsNotGuessed) {
  const Robot robot = robot_of("panda");
  EXPECT_NE(error_of([&] {
              checked_effect({"joint_spring", {2}, {{"rest", {0.1}}}}, robot);
            }).find("parameter 'stiffness' is missing"),
            std::string::npos);
  EXPECT_EQ(checked_effect({"joint_spring", {2}, {{"stiffness", {3.0}}}}, robot).parameters.at("rest"),
            std::vector<double>(7, 0.0));
  EXPECT_NE(error_of([&] {
              checked_effect({"joint_spring", {}, {{"stiffness", {3.0}}}}, robot);
            }).find("joints are missing"),
            std::string::npos);
}

}  // namespace
}  // namespace dynid
