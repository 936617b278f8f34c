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
#include "dynid/identification/predict.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/plant.hpp"
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
  options.measurement.white_noise = 0.02 / 87.0;  // 0.02 N m on a joint of 87 N m
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
                                        "payload:mass=1.5,com=0.02:0:0.06,radius=0.05",
                                        "joint_spring:joints=2,stiffness=12,rest=0.2"};

/// The same three as a diagnosis that is right would find them: the payload in the last link's frame.
std::vector<FoundEffect> found(const Robot& robot) {
  const Eigen::Vector3d com = robot.tip * Eigen::Vector3d(0.02, 0.0, 0.06);
  const double inertia = 0.4 * 1.5 * 0.05 * 0.05;
  std::vector<FoundEffect> effects(3);
  effects[0].effect = {"viscous_friction", {2, 4}, {{"coefficient", {0, 2.5, 0, 3, 0, 0, 0}}}};
  effects[1].effect = {"payload",
                       {1, 2, 3, 4, 5, 6, 7},
                       {{"mass", {1.5}},
                        {"com", {com[0], com[1], com[2]}},
                        {"inertia", {inertia, 0, 0, inertia, 0, inertia}}}};
  effects[2].effect = {
      "joint_spring", {2}, {{"stiffness", {0, 12, 0, 0, 0, 0, 0}}, {"rest", {0, 0.2, 0, 0, 0, 0, 0}}}};
  return effects;
}

TEST(Patch, PredictsTheTorquesOfAnotherLog) {
  const Robot nominal = panda(), better = patched(nominal, found(nominal));
  const Log log = logged(nominal, three, 13);
  EXPECT_LT(rms_error(better, log), 0.03 * rms_error(nominal, log));
}

// Law: what a model says of effects is part of its torque, whether they are in its parameters (payload), or
// beside them (spring, ripple): against such a robot it has no gap, and what it does not say is found beside.
TEST(Patch, LeavesNoGap) {
  const std::vector<std::string> named = {"payload:mass=1.5,com=0.02:0:0.06,radius=0.05",
                                          "joint_spring:joints=2,stiffness=12,rest=0.2",
                                          "torque_ripple:joints=4,amplitude=2,order=5,phase=0.3"};
  std::vector<FoundEffect> effects = found(panda());
  effects.erase(effects.begin());
  effects.emplace_back();
  effects.back().effect = {"torque_ripple",
                           {4},
                           {{"amplitude", {0, 0, 0, 2, 0, 0, 0}},
                            {"order", {0, 0, 0, 5, 0, 0, 0}},
                            {"phase", {0, 0, 0, 0.3, 0, 0, 0}}}};
  const Robot better = patched(panda(), effects);
  const auto logs = [&](std::vector<std::string> more) {
    more.insert(more.begin(), named.begin(), named.end());
    return std::vector<Log>{logged(panda(), more, 17), logged(panda(), more, 18)};
  };
  const Diagnosis whole = diagnose(better, logs({}));
  EXPECT_EQ(whole.verdict, Verdict::no_gap) << to_string(whole.verdict);
  EXPECT_TRUE(whole.effects.empty());
  EXPECT_LT(whole.rollout.before[1], 2e-2) << "the replay takes the named effects off";

  const Diagnosis one = diagnose(better, logs({"viscous_friction:joints=2+4,coefficient=2.5:3"}));
  ASSERT_EQ(one.effects.size(), 1u) << to_string(one.verdict);
  EXPECT_EQ(one.effects[0].effect.name, "viscous_friction");
  EXPECT_NEAR(one.effects[0].effect.parameters.at("coefficient")[1], 2.5, 0.1);
  EXPECT_LT(one.rollout.after[1], 0.2 * one.rollout.before[1]);
}

// Law: what an effect adds to a channel that is late is as late.
TEST(Patch, WhatOtherEffectsAddIsAsLate) {
  const Robot nominal = panda();
  const Log log = logged(nominal, {}, 15);
  const auto effects = [&](const std::vector<std::string>& texts) {
    Robot robot = nominal;
    for (const std::string& text : texts) robot.effects.push_back(parse_effect(text, robot));
    return predict_effects(robot, log);
  };
  const std::string delay = "time_delay:delay_s=0.02",
                    ripple = "torque_ripple:joints=2+4,amplitude=2,order=5,phase=0.3";
  const Eigen::MatrixXd both = effects({ripple, delay}), alone = effects({delay}), now = effects({ripple});
  Eigen::MatrixXd late = now;
  for (auto column : late.colwise())
    column = interpolate(log.t, Eigen::VectorXd(column), log.t.array() - 0.02);
  const Eigen::Index inside = log.samples() - 50;
  EXPECT_LT((both - alone - late).bottomRows(inside).norm(), 1e-3 * now.norm());
  EXPECT_GT((both - alone - now).bottomRows(inside).norm(), 0.02 * now.norm());
}

TEST(Rollout, ReplaysWhatTheModelMade) {
  // Law: without a gap the replay is the motion itself, as far as the noise lets it.
  const Rollout r = diagnose(panda(), {logged(panda(), {}, 21), logged(panda(), {}, 22)}).rollout;
  ASSERT_EQ(r.horizon.size(), 3);
  EXPECT_LT(r.before[0], 2e-3) << r.before.transpose();
  EXPECT_LT(r.before[1], 2e-2) << r.before.transpose();
}

TEST(Rollout, ShrinksWithTheEffect) {
  const std::vector<std::string> effect = {"viscous_friction:joints=2+4,coefficient=2.5:3"};
  const Diagnosis d = diagnose(panda(), {logged(panda(), effect, 11), logged(panda(), effect, 12)});
  ASSERT_EQ(d.effects.size(), 1u) << to_string(d.verdict);
  const Rollout& r = d.rollout;
  ASSERT_EQ(r.horizon.size(), 3);
  for (int k = 0; k < 2; ++k) EXPECT_LT(r.after[k], 0.1 * r.before[k]) << r.horizon[k] << " s";
  EXPECT_EQ(r.log, 1) << "the log that judges";
}

TEST(Patch, GoesBackIntoTheSimulation) {
  const Robot better = patched(panda(), found(panda()));
  const Log again = logged(better, {}, 14);
  EXPECT_LT(rms_error(better, again), 0.03 * rms_error(panda(), again));
}

// Law: a bristle and a slip element of the same stiffness are one effect in two forms, for the plant and for
// the fitted law alike.
TEST(Patch, BothFormsOfPreslidingAreTheSame) {
  Robot slip = panda(), bristle = panda();
  const std::vector<double> coulomb = {0, 0, 1.2, 0, 0, 0, 0};
  slip.effects = {{"presliding_hysteresis", {3}, {{"coulomb", coulomb}, {"slip", {0.04}}}}};
  bristle.effects = {
      {"presliding_hysteresis", {3}, {{"coulomb", coulomb}, {"stiffness", {30.0}}, {"damping", {0.0}}}}};
  const Log log = logged(slip, {}, 16), other = logged(bristle, {}, 16);
  EXPECT_LT((log.tau - other.tau).cwiseAbs().maxCoeff(), 1e-9);
  const Eigen::MatrixXd a = predict_effects(slip, log), b = predict_effects(bristle, log);
  EXPECT_GT(a.norm(), 1.0);
  EXPECT_LT((a - b).norm(), 1e-9 * a.norm());
}

// Either form of a backlash is the simulation's backlash again; a dead zone takes there what it takes here, a
// gap's blows are too sharp to be compared instant by instant.
TEST(Patch, BothFormsOfBacklashAreSimulated) {
  Robot robot = panda();
  robot.effects.push_back(
      {"backlash",
       {4},
       {{"dead_zone", {0, 0, 0, 0.9, 0, 0, 0}}, {"contact_torque", {0, 0, 0, 0.1, 0, 0, 0}}}});
  const Log dead_zone = logged(robot, {}, 14);
  EXPECT_LT(rms_error(robot, dead_zone), 0.2 * rms_error(panda(), dead_zone));
  robot.effects[0].parameters = {{"gap", {0, 0, 0, 0.02, 0, 0, 0}}, {"stiffness", {0, 0, 0, 15000, 0, 0, 0}}};
  EXPECT_EQ(complete_effect(robot.effects[0], robot).parameters.at("gap")[3], 0.02);
  EXPECT_NO_THROW(Plant{robot});
}

// A joint that warms by its own motion becomes the simulation's, whose friction falls straight instead.
TEST(Patch, DriftByMotionIsSimulated) {
  Robot robot = panda();
  robot.effects.push_back(
      {"thermal_friction_drift",
       {2, 4},
       {{"coefficient", {0, 3, 0, 4, 0, 0, 0}}, {"motion_constant", {0, 1, 0, 2, 0, 0, 0}}}});
  const Log log = logged(robot, {}, 14);
  EXPECT_LT(rms_error(robot, log), 0.4 * rms_error(panda(), log));
}

TEST(Patch, WhatCannotBeSimulatedIsRefusedByName) {
  Robot robot = panda();
  robot.effects.push_back({"external_contact",
                           {1, 2, 3, 4, 5},
                           {{"link", {5}},
                            {"force", {1, 0, 0}},
                            {"moment", {0, 2, 0}},
                            {"start", {1}},
                            {"duration", {1}},
                            {"rise_time", {0.02}}}});
  try {
    const Plant plant(robot);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("external_contact"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("point"), std::string::npos) << error.what();
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
  const Log other = logged(nominal, three, 33);
  const Robot better = patched(nominal, found(nominal));
  const double before = mujoco_error(nominal, other), after = mujoco_error(better, other);
  std::printf("  MuJoCo, 0.5 s: %.3g rad, patched %.3g rad\n", before, after);
  EXPECT_LT(after, 0.2 * before);
}
#else
TEST(Patch, MujocoReplaysTheLogBetter) { GTEST_SKIP() << "MuJoCo is not installed"; }
#endif

}  // namespace
}  // namespace dynid
