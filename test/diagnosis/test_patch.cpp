// SPDX-License-Identifier: Apache-2.0
// A patched model says more of the robot than the nominal one: in its own torques, in this library's replay
// and in MuJoCo's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/diagnosis/effect_prediction.hpp"
#include "dynid/diagnosis/for_simulation.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#ifdef DYNID_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace dynid {
namespace {

Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

/// A log of 12 s of the robot with effects, at 250 Hz, with a little white noise.
Log logged(const Robot& robot, const std::vector<std::string>& effects, unsigned long seed) {
  std::vector<Effect> parsed;
  for (const std::string& text : effects) parsed.push_back(parse_effect(text, robot));
  SimulateOptions options;
  options.measurement.white_noise = 0.02;
  options.seed = seed;
  options.rate = 250.0;
  options.record_torques = false;
  return simulate(robot, parsed, random_motion(robot, 12.0, seed), options).log;
}

double rms_error(const Robot& robot, const Log& log) {
  const Eigen::MatrixXd e = predict_torque(robot, log).tau + predict_effects(robot, log) - log.tau;
  return std::sqrt(e.squaredNorm() / double(e.size()));
}

const std::vector<std::string> three = {"viscous_friction:joints=2+4,coefficient=2.5:3",
                                        "payload:mass=1.5,com=0.02:0:0.06",
                                        "joint_spring:joints=2,stiffness=12,rest=0.2"};

/// Found once for all tests.
const Diagnosis& found() {
  static const Diagnosis diagnosis =
      diagnose(panda(), {logged(panda(), three, 11), logged(panda(), three, 12)});
  return diagnosis;
}

TEST(Patch, PredictsTheTorquesOfAnotherLog) {
  const Robot nominal = panda(), better = patched(nominal, found().effects);
  const Log other = logged(nominal, three, 13);
  EXPECT_LT(rms_error(better, other), 0.15 * rms_error(nominal, other));
}

TEST(Rollout, ReplaysWhatTheModelMade) {
  // Law: without a gap and without noise the replay is the motion itself.
  SimulateOptions options;
  options.rate = 250.0;
  options.record_torques = false;
  std::vector<Log> logs;
  for (const unsigned long seed : {21UL, 22UL})
    logs.push_back(simulate(panda(), {}, random_motion(panda(), 12.0, seed), options).log);
  const Rollout r = diagnose(panda(), logs).rollout;
  ASSERT_EQ(r.horizon.size(), 3);
  EXPECT_LT(r.before[0], 1e-3) << r.before.transpose();
  EXPECT_LT(r.before[1], 5e-3) << r.before.transpose();
  EXPECT_TRUE(r.before.isApprox(r.after));
}

TEST(Rollout, ShrinksWithTheEffects) {
  const Rollout& r = found().rollout;
  ASSERT_EQ(r.horizon.size(), 3);
  for (int k = 0; k < 2; ++k) EXPECT_LT(r.after[k], 0.1 * r.before[k]) << r.horizon[k] << " s";
  EXPECT_EQ(r.log, 1) << "the log that judges";
}

TEST(Patch, GoesBackIntoTheSimulation) {
  const Robot better = patched(panda(), found().effects), truth = for_simulation(better);
  const Log again = logged(truth, {}, 14);
  EXPECT_LT(rms_error(better, again), 0.15 * rms_error(panda(), again));
}

TEST(Patch, SlipElementsBecomeBristlesOfTheSameStiffness) {
  Robot robot = panda();
  robot.effects.push_back({"presliding_hysteresis",
                           {3},
                           {{"coulomb", {0, 0, 1.2, 0, 0, 0, 0}}, {"slip", {0, 0, 0.04, 0, 0, 0, 0}}}});
  robot.effects.push_back({"asymmetric_coulomb_friction",
                           {1, 2},
                           {{"coefficient_positive", {1, 2, 0, 0, 0, 0, 0}},
                            {"coefficient_negative", {3, 4, 0, 0, 0, 0, 0}},
                            {"velocity_scale", {0.01, 0.02, 0, 0, 0, 0, 0}}}});
  const Robot ready = for_simulation(robot);
  ASSERT_EQ(ready.effects.size(), 3u);
  EXPECT_NEAR(ready.effects[0].parameters.at("stiffness")[2], 30.0, 1e-12);
  EXPECT_EQ(ready.effects[1].joints, std::vector<int>{1});
  EXPECT_EQ(ready.effects[2].parameters.at("velocity_scale"), std::vector<double>{0.02});
  for (const Effect& e : ready.effects) EXPECT_NO_THROW(complete_effect(e, ready));
}

TEST(Patch, WhatCannotBeSimulatedIsRefusedByName) {
  Robot robot = panda();
  robot.effects.push_back(
      {"external_contact",
       {1, 2, 3, 4, 5},
       {{"link", {5}}, {"force", {1, 0, 0}}, {"moment", {0, 2, 0}}, {"start", {1}}, {"duration", {1}}}});
  try {
    for_simulation(robot);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("external_contact"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("moment"), std::string::npos) << error.what();
  }
}

#ifdef DYNID_HAVE_MUJOCO
/// Median over starts of the position error [rad, rms over joints] after 0.5 s in MuJoCo under the measured
/// torques.
double mujoco_error(const Robot& robot, const Log& log) {
  const PrepareOptions options;
  const PreparedLog prepared = prepare(log, options);
  const Segment& s = prepared.segments.front();
  const auto vfs = std::make_unique<mjVFS>();  // large
  mj_defaultVFS(vfs.get());
  const std::string xml = to_mjcf(robot).text;
  char message[1000] = "";
  mj_makeEmptyFileVFS(vfs.get(), "robot.xml", static_cast<int>(xml.size()));
  std::copy(xml.begin(), xml.end(),
            static_cast<char*>(vfs->filedata[mj_findFileVFS(vfs.get(), "robot.xml")]));
  mjModel* const model = mj_loadXML("robot.xml", vfs.get(), message, sizeof message);
  mj_deleteVFS(vfs.get());
  if (model == nullptr) throw Error(message);
  mjData* const data = mj_makeData(model);
  const auto steps = static_cast<Eigen::Index>(std::lround(0.5 * s.rate));
  constexpr int substeps = 4;
  model->opt.timestep = 1.0 / (s.rate * substeps);
  const int n = robot.size();
  std::vector<double> errors;
  for (Eigen::Index first = steps; first + steps < s.t.size(); first += steps) {
    mj_resetData(model, data);
    for (int j = 0; j < n; ++j) {
      data->qpos[j] = s.q(first, j);
      data->qvel[j] = s.dq(first, j);
    }
    for (Eigen::Index i = 0; i < steps; ++i) {
      for (int k = 0; k < substeps; ++k) {
        const double part = (k + 0.5) / substeps;
        for (int j = 0; j < n; ++j)
          data->qfrc_applied[j] = (1.0 - part) * s.tau(first + i, j) + part * s.tau(first + i + 1, j);
        mj_step(model, data);
      }
    }
    double sum = 0.0;
    for (int j = 0; j < n; ++j) sum += std::pow(data->qpos[j] - s.q(first + steps, j), 2);
    errors.push_back(std::sqrt(sum / n));
  }
  mj_deleteData(data);
  mj_deleteModel(model);
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

TEST(Patch, MujocoReplaysTheLogBetter) {
  // MJCF has no sigmoid friction: a robot without it.
  Robot nominal = panda();
  for (Joint& joint : nominal.joints) joint.friction = {};
  const Log a = logged(nominal, three, 31), b = logged(nominal, three, 32),
            other = logged(nominal, three, 33);
  const Diagnosis d = diagnose(nominal, {a, b});
  const Robot better = patched(nominal, d.effects);
  const double before = mujoco_error(nominal, other), after = mujoco_error(better, other);
  std::printf("  MuJoCo, 0.5 s: %.3g rad, patched %.3g rad\n", before, after);
  EXPECT_LT(after, 0.2 * before);
}
#else
TEST(Patch, MujocoReplaysTheLogBetter) { GTEST_SKIP() << "MuJoCo is not installed"; }
#endif

}  // namespace
}  // namespace dynid
