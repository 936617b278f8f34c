// SPDX-License-Identifier: Apache-2.0
//
// Servo logs: commands and positions, no torque. Laws first (what an effect does is named, with its size; a
// healthy arm has none; units, order of threads, the patch), then the real SO-101.
#include "dynid/diagnosis/servo_diagnose.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>

#include "dynid/app/diagnose.hpp"
#include "dynid/app/servo_diagnosis.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/servo_plant.hpp"
#include "simulation/robots.hpp"

namespace dynid {
namespace {

constexpr double frequency = 18.0;  // [rad/s] of every servo

/// The published Panda, whose joints have servos of one natural frequency, some friction, and rotors.
Robot servo_arm() {
  Robot robot = test::panda();
  Model<> model(robot);
  Workspace<> ws(model);
  Eigen::VectorXd q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const JointLimits& l = robot.joints[std::size_t(j)].limits;
    q[j] = 0.5 * (l.lower + l.upper) + 0.3;
  }
  Eigen::MatrixXd M(robot.size(), robot.size());
  mass_matrix(model, ws, q, M);
  robot.effects.clear();
  for (int j = 0; j < robot.size(); ++j) {
    Joint& joint = robot.joints[std::size_t(j)];
    joint.rotor_inertia = 0.3 * M(j, j);
    const double inertia = M(j, j) + joint.rotor_inertia;
    Servo servo;
    servo.kp = inertia * frequency * frequency;
    servo.kd = 1.6 * frequency * inertia;
    joint.servo = servo;
    joint.friction = {};
    joint.friction.linear.viscous = 0.1 * servo.kd;
    joint.friction.linear.coulomb = 0.005 * servo.kp;
    joint.limits.velocity = 1.0;
    joint.limits.acceleration = 4.0;
  }
  return robot;
}

/// Commands of a random motion, `size` times as far from its middle, and the motion that `robot` makes of
/// them, in much finer steps than are fitted, on an encoder of steps of 0.4 mrad.
Log recorded(const Robot& robot, unsigned seed, double duration, const std::vector<int>& at_rest = {},
             double size = 1.0) {
  constexpr double rate = 100.0;  // [Hz]
  RandomMotionOptions options;
  options.rate = rate;
  options.base_frequency = 0.1;
  options.harmonics = 6;
  const Trajectory motion = random_motion(robot, duration, seed, options);
  Log log;
  log.source = "log " + std::to_string(seed);
  log.t = Eigen::VectorXd::LinSpaced(motion.q.rows(), 0.0, double(motion.q.rows() - 1) / rate);
  const Eigen::RowVectorXd middle = motion.q.colwise().mean();
  log.u = (size * (motion.q.rowwise() - middle)).rowwise() + middle;
  for (const int j : at_rest) log.u.col(j).setConstant(motion.q(0, j));
  log.q = log.u;
  constexpr double step = 4e-4;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.2 * step);
  log.q = replay_servos(robot, log, 40).q.unaryExpr([&](double q) {
    return step * std::round((q + noise(random)) / step);
  });
  return log;
}

std::vector<Log> two_logs(const Robot& robot, const std::vector<int>& at_rest = {}) {
  return {recorded(robot, 5, 20.0, at_rest), recorded(robot, 6, 20.0, at_rest)};
}

DiagnoseServosOptions without_rollout() {
  DiagnoseServosOptions options;
  options.rollout = false;
  return options;
}

/// An effect put into a robot, by the name that has to come out, the joint, and the key and size of its first
/// number.
struct Hidden {
  const char* name;
  int joint;
  const char* key;
  double part;  ///< of the joint's own size: see hide()
};

double hide(Robot& robot, const Hidden& h) {
  Joint& joint = robot.joints[std::size_t(h.joint - 1)];
  Servo& servo = *joint.servo;
  const std::string name = h.name;
  const double interval = 0.01;
  if (name == "servo_stiffness") return servo.kp *= h.part;
  if (name == "servo_damping") return servo.kd *= 1.0 + h.part, h.part * servo.kd / (1.0 + h.part);
  if (name == "command_delay") return servo.delay = h.part * interval;
  if (name == "command_filter") return servo.command_time_constant = h.part * interval;
  if (name == "coulomb_friction") {
    joint.friction.linear.coulomb += h.part * servo.kp;
    return h.part * servo.kp;
  }
  if (name == "rotor_inertia") {
    const double more = h.part * joint.rotor_inertia;
    joint.rotor_inertia += more;
    return more;
  }
  if (name == "encoder_offset") return servo.bias = h.part;
  if (name == "load_dependent_friction") return servo.load_friction = h.part;
  if (name == "stribeck_friction") {
    servo.stribeck_position = h.part;
    servo.stribeck_velocity = 0.12;
    return h.part * servo.kp;
  }
  if (name == "torque_saturation") return servo.torque_limit = h.part * servo.kp;
  if (name == "backlash") {
    std::vector<double> gap(robot.joints.size(), 0.0), stiffness = gap;
    gap[std::size_t(h.joint - 1)] = h.part;
    stiffness[std::size_t(h.joint - 1)] = 10.0 * servo.kp;
    robot.effects.push_back({"backlash", {h.joint}, {{"gap", gap}, {"stiffness", stiffness}}});
    return h.part;
  }
  ADD_FAILURE() << "no such effect: " << name;
  return 0.0;
}

const FoundEffect* find(const Diagnosis& d, const std::string& name) {
  const auto at = std::find_if(d.effects.begin(), d.effects.end(),
                               [&](const FoundEffect& e) { return e.effect.name == name; });
  return at == d.effects.end() ? nullptr : &*at;
}

/// CONTRACT: `explained` never stands beside a probability below 0.5 or a shrink below 0.65; every number is
/// one.
void expect_no_contradiction(const Diagnosis& d) {
  if (d.verdict == Verdict::explained) {
    EXPECT_GE(d.shrink.fraction, 0.65);
    for (const FoundEffect& e : d.effects) EXPECT_GE(e.probability, 0.5) << e.effect.name;
  }
  if (d.verdict == Verdict::no_gap || d.verdict == Verdict::unexplained) {
    EXPECT_TRUE(d.effects.empty());
  }
  for (std::size_t k = 1; k < d.effects.size(); ++k) EXPECT_GE(d.effects[k - 1].share, d.effects[k].share);
  for (const GapCell& cell : d.where) EXPECT_TRUE(cell.share >= 0.0 && cell.share <= 1.0) << cell.share;
  for (const Eigen::VectorXd* x : {&d.rms, &d.floor, &d.tolerance, &d.upper}) EXPECT_TRUE(x->allFinite());
}

class ServoEffectIsNamed : public testing::TestWithParam<Hidden> {};

TEST_P(ServoEffectIsNamed, OnItsJointWithItsSize) {
  const Hidden& hidden = GetParam();
  const Robot nominal = servo_arm();
  Robot real = nominal;
  const double size = hide(real, hidden);
  const Diagnosis d = diagnose_servos(nominal, two_logs(real), without_rollout());
  expect_no_contradiction(d);
  ASSERT_FALSE(d.effects.empty()) << d.judgement.back().criterion << ": " << d.judgement.back().text;
  EXPECT_EQ(d.effects.front().effect.name, hidden.name);
  const FoundEffect* found = find(d, hidden.name);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->effect.joints, std::vector<int>{hidden.joint});
  EXPECT_GE(found->probability, 0.5);
  EXPECT_GT(found->share, 0.9);
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_GT(d.shrink.fraction, 0.9);
  const ParameterEstimate& first = found->parameters.front();
  ASSERT_EQ(first.key, hidden.key);
  const double value = first.value[hidden.joint - 1];
  EXPECT_NEAR(value, size, 0.1 * std::abs(size));
  EXPECT_LT(first.low[hidden.joint - 1], value);
  EXPECT_GT(first.high[hidden.joint - 1], value);
  for (const FoundEffect& e : d.effects)
    EXPECT_TRUE(e.effect.name == hidden.name || e.probability < 0.9) << e.effect.name << " is not there";
}

INSTANTIATE_TEST_SUITE_P(
    Catalogue, ServoEffectIsNamed,
    testing::Values(Hidden{"servo_stiffness", 4, "kp", 0.7}, Hidden{"servo_damping", 2, "coefficient", 0.6},
                    Hidden{"command_delay", 1, "delay", 3.0},
                    Hidden{"command_filter", 3, "time_constant", 4.0},
                    Hidden{"coulomb_friction", 6, "coefficient", 0.03},
                    Hidden{"rotor_inertia", 1, "armature", 8.0}, Hidden{"encoder_offset", 5, "offset", 0.02},
                    Hidden{"load_dependent_friction", 4, "coefficient", 0.3},
                    Hidden{"stribeck_friction", 7, "static", 0.02},
                    Hidden{"torque_saturation", 3, "limit", 0.035}, Hidden{"backlash", 2, "gap", 0.04}),
    [](const testing::TestParamInfo<Hidden>& hidden) { return std::string(hidden.param.name); });

// What a wide tolerance makes of it: by its size the gap may be the model's own, by its shape it is not.
TEST(ServoDiagnosis, WithinTheToleranceNoNameIsSure) {
  const Robot nominal = servo_arm();
  for (const Hidden& hidden :
       {Hidden{"command_delay", 1, "delay", 3.0}, Hidden{"backlash", 2, "gap", 0.04}}) {
    Robot real = nominal;
    hide(real, hidden);
    const std::vector<Log> logs = two_logs(real);
    for (const double tolerance : {0.02, 0.4}) {
      DiagnoseServosOptions options = without_rollout();
      options.tolerance = tolerance;
      const Diagnosis d = diagnose_servos(nominal, logs, options);
      const FoundEffect* found = find(d, hidden.name);
      ASSERT_NE(found, nullptr) << hidden.name << " at " << tolerance;
      if (tolerance < 0.1) {
        EXPECT_GT(found->probability, 0.95) << hidden.name;
      } else {
        EXPECT_LE(found->probability, options.criteria.most_probable) << hidden.name;
        EXPECT_GE(found->probability, 0.5) << hidden.name;
      }
    }
  }
}

// A limit that one log reaches and the other does not: whichever is the last, it is found and borne out.
TEST(ServoDiagnosis, AGapThatOneLogShowsIsFoundWhicheverIsTheLast) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  const double limit = hide(real, {"torque_saturation", 3, "limit", 0.035});
  const std::vector<Log> far_then_near = {recorded(real, 5, 20.0), recorded(real, 6, 20.0, {}, 0.2)},
                         near_then_far = {far_then_near[1], far_then_near[0]};
  for (const std::vector<Log>* logs : {&far_then_near, &near_then_far}) {
    const Diagnosis d = diagnose_servos(nominal, *logs, without_rollout());
    expect_no_contradiction(d);
    ASSERT_FALSE(d.effects.empty()) << d.judgement.back().text;
    EXPECT_EQ(d.effects.front().effect.name, "torque_saturation");
    EXPECT_NEAR(d.effects.front().effect.parameters.at("limit")[2], limit, 0.1 * limit);
    EXPECT_EQ(d.verdict, Verdict::explained);
    EXPECT_GT(d.shrink.fraction, 0.9);
  }
}

TEST(ServoDiagnosis, NamesAPayload) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  LinkInertia weight;
  weight.mass = 2.0;
  weight.com = {0.02, -0.01, 0.08};
  real.joints.back().parameters += to_standard(weight);
  const Diagnosis d = diagnose_servos(nominal, two_logs(real), without_rollout());
  ASSERT_FALSE(d.effects.empty());
  EXPECT_EQ(d.effects.front().effect.name, "payload");
  EXPECT_NEAR(d.effects.front().effect.parameters.at("mass")[0], 2.0, 0.12);
  EXPECT_NEAR(d.effects.front().effect.parameters.at("com")[2], 0.08, 0.01);
  EXPECT_EQ(d.verdict, Verdict::explained);
  // In the last link of the patch, where a simulator looks for it.
  const Robot patch = patched_servos(nominal, d.effects);
  EXPECT_NEAR(patch.joints.back().parameters[0] - nominal.joints.back().parameters[0], 2.0, 0.12);
}

TEST(ServoDiagnosis, AHealthyArmHasNoGap) {
  const Robot nominal = servo_arm();
  Robot real = nominal;  // within the tolerance: another copy of the same arm
  std::mt19937_64 random(3);
  std::normal_distribution<double> off(1.0, 0.01);
  for (Joint& joint : real.joints) {
    joint.parameters *= off(random);
    joint.servo->kp *= off(random);
    joint.servo->kd *= off(random);
    joint.friction.linear.coulomb *= off(random);
  }
  for (const Robot* robot : {&nominal, static_cast<const Robot*>(&real)}) {
    const Diagnosis d = diagnose_servos(nominal, two_logs(*robot), without_rollout());
    EXPECT_TRUE(d.verdict == Verdict::no_gap || d.verdict == Verdict::not_detected);
    EXPECT_TRUE(d.effects.empty());
    EXPECT_GT(d.p_value, 0.05);
  }
}

// As any copy of an arm is: every servo, friction and body off by the tolerance (one standard deviation,
// which the size of the gap may show), masses' places with them.
TEST(ServoDiagnosis, BodiesThatAreOffHaveNoName) {
  const Robot nominal = servo_arm();
  for (const unsigned long seed : {1UL, 2UL}) {
    const Robot real = perturbed_servos(nominal, DiagnoseServosOptions{}.tolerance, seed);
    const Diagnosis d = diagnose_servos(nominal, two_logs(real), without_rollout());
    EXPECT_TRUE(d.effects.empty());
  }
}

// Most logs of a person move a joint or two: nothing is said of the others, and what is said of those is the
// same.
TEST(ServoDiagnosis, JointsAtRestSayNothing) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  hide(real, {"servo_stiffness", 2, "kp", 0.7});
  const std::vector<int> at_rest = {2, 5};
  std::vector<Log> logs = two_logs(real, at_rest);
  for (Log& log : logs)  // an encoder that shows not a step
    for (const int j : at_rest) log.q.col(j).setConstant(log.q(log.samples() / 2, j));
  const Diagnosis d = diagnose_servos(nominal, logs, without_rollout());
  expect_no_contradiction(d);
  ASSERT_NE(find(d, "servo_stiffness"), nullptr);
  EXPECT_GT(find(d, "servo_stiffness")->share, 0.9);
  for (const FoundEffect& e : d.effects)
    for (const int j : at_rest)
      EXPECT_EQ(std::count(e.effect.joints.begin(), e.effect.joints.end(), j + 1), 0) << e.effect.name;
  EXPECT_GT(d.floor.minCoeff(), 0.1 * d.floor.maxCoeff());
}

TEST(ServoDiagnosis, WithheldEffectsAreNotNamed) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  hide(real, {"command_delay", 1, "delay", 3.0});
  DiagnoseServosOptions options = without_rollout();
  options.withhold = {"command_delay"};
  EXPECT_EQ(find(diagnose_servos(nominal, two_logs(real), options), "command_delay"), nullptr);
}

TEST(ServoDiagnosis, ThePatchMovesAsItSays) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  hide(real, {"servo_stiffness", 2, "kp", 1.4});
  hide(real, {"backlash", 4, "gap", 0.03});
  const std::vector<Log> logs = two_logs(real);
  const Diagnosis d = diagnose_servos(nominal, logs, {});
  ASSERT_NE(find(d, "servo_stiffness"), nullptr);
  ASSERT_NE(find(d, "backlash"), nullptr);
  const ServoReplay replay = replay_servos(patched_servos(nominal, d.effects), logs.back());
  for (int j = 0; j < nominal.size(); ++j)
    EXPECT_NEAR(d.shrink.after[j],
                std::sqrt((replay.q - logs.back().q).col(j).squaredNorm() / double(replay.q.rows())), 1e-9);
  ASSERT_EQ(d.rollout.horizon.size(), 3);
  EXPECT_LT(d.rollout.after[2], 0.5 * d.rollout.before[2]);
}

// What is eight times as heavy and as strong moves the same way, and is diagnosed the same way.
TEST(ServoDiagnosis, KnowsNoTorque) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  hide(real, {"coulomb_friction", 6, "coefficient", 0.03});
  const auto heavier = [](Robot robot) {
    for (Joint& joint : robot.joints) {
      joint.parameters *= 8.0;
      joint.rotor_inertia *= 8.0;
      joint.servo->kp *= 8.0;
      joint.servo->kd *= 8.0;
      joint.friction.linear.viscous *= 8.0;
      joint.friction.linear.coulomb *= 8.0;
    }
    return robot;
  };
  const Diagnosis light = diagnose_servos(nominal, two_logs(real), without_rollout()),
                  heavy = diagnose_servos(heavier(nominal), two_logs(heavier(real)), without_rollout());
  ASSERT_EQ(light.effects.size(), heavy.effects.size());
  EXPECT_EQ(light.verdict, heavy.verdict);
  EXPECT_NEAR(light.shrink.fraction, heavy.shrink.fraction, 1e-3);
  for (std::size_t k = 0; k < light.effects.size(); ++k) {
    EXPECT_EQ(light.effects[k].effect.name, heavy.effects[k].effect.name);
    EXPECT_NEAR(8.0 * light.effects[k].effect.parameters.at("coefficient")[5],
                heavy.effects[k].effect.parameters.at("coefficient")[5],
                0.01 * heavy.effects[k].effect.parameters.at("coefficient")[5]);
  }
}

TEST(ServoDiagnosis, IsTheSameOnOneThread) {
  const Robot nominal = servo_arm();
  Robot real = nominal;
  hide(real, {"encoder_offset", 3, "offset", 0.02});
  hide(real, {"command_delay", 5, "delay", 3.0});
  const std::vector<Log> logs = two_logs(real);
  const Diagnosis several = diagnose_servos(nominal, logs, without_rollout());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Diagnosis alone = diagnose_servos(nominal, logs, without_rollout());
  ASSERT_EQ(several.effects.size(), alone.effects.size());
  for (std::size_t k = 0; k < alone.effects.size(); ++k) {
    EXPECT_EQ(several.effects[k].effect.parameters, alone.effects[k].effect.parameters);
    EXPECT_EQ(several.effects[k].probability, alone.effects[k].probability);
  }
}

TEST(ServoDiagnosis, SaysWhatIsMissing) {
  const Robot nominal = servo_arm();
  Robot without = nominal;
  without.joints[2].servo.reset();
  const Log log = recorded(nominal, 5, 5.0);
  EXPECT_THROW(
      try { diagnose_servos(without, {log}, {}); } catch (const Error& e) {
        EXPECT_NE(std::string(e.what()).find(without.joints[2].name), std::string::npos) << e.what();
        throw;
      },
      Error);
  Log still = log;
  still.u.rowwise() = log.u.row(0).eval();
  EXPECT_EQ(diagnose_servos(nominal, {still}, {}).verdict, Verdict::data_invalid);
  Log degrees = log;
  degrees.u *= 180.0 / M_PI;
  EXPECT_THROW(diagnose_servos(nominal, {degrees}, {}), Error);
  Log unheard = log;
  unheard.u.resize(0, 0);
  EXPECT_THROW(is_servo_diagnosis(nominal, {unheard}), Error);
  EXPECT_TRUE(is_servo_diagnosis(nominal, {log}));
}

// GAP_METHOD's "Servo logs": three motions, judged on others that are not fitted.
TEST(ServoDiagnosis, TheShippedModelOfARealArm) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set";
  const std::string folder = std::string(data) + "/so101_real/";
  const Robot shipped = read_model_file(folder + "so101_new_calib.xml").robot;
  std::vector<Log> logs;
  for (const char* name : {"chirp_sweep", "multisine", "friction_gravity", "wave_motion"})
    logs.push_back(read_log(folder + name + ".csv", shipped.size(), diagnosis_columns(shipped)));
  const Diagnosis d = diagnose_servos(shipped, logs, without_rollout());
  expect_no_contradiction(d);
  EXPECT_GT(d.shrink.fraction, 0.9);
  ASSERT_FALSE(d.effects.empty());
  EXPECT_EQ(d.effects.front().effect.name, "servo_stiffness");
  for (const FoundEffect& e : d.effects)
    EXPECT_LT(e.probability, 0.9) << e.effect.name;  // its forms leave more
  // On motions that took no part at all.
  const Robot patch = patched_servos(shipped, d.effects);
  for (const char* name : {"large_amplitude", "coupled_joints", "sinusoidal_sweep"}) {
    const Log log = read_log(folder + name + ".csv", shipped.size(), diagnosis_columns(shipped));
    EXPECT_LT(replay_servos(patch, log).error.mean(), 0.6 * replay_servos(shipped, log).error.mean()) << name;
  }
}

// Four joints of six at rest, and names that come and go as the width of the loss does: an answer, with its
// numbers.
TEST(ServoDiagnosis, ARealArmOfWhichOneJointMoves) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set";
  const std::string folder = std::string(data) + "/so101_real/";
  const Robot shipped = read_model_file(folder + "so101_new_calib.xml").robot;
  const Log log = read_log(folder + "single_joint_rotation.csv", shipped.size(), diagnosis_columns(shipped));
  const Diagnosis d = diagnose_servos(shipped, {log}, without_rollout());
  expect_no_contradiction(d);
  EXPECT_LT(d.p_value, 0.05);
  for (const FoundEffect& e : d.effects)
    for (const int joint : e.effect.joints) EXPECT_LE(joint, 2) << e.effect.name;
}

}  // namespace
}  // namespace dynid
