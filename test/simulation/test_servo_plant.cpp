// SPDX-License-Identifier: Apache-2.0
//
// An arm that follows commanded positions: what it must do whatever the arm, then its agreement with
// replay_servos(), which is written apart from it and integrates otherwise.
#include "dynid/simulation/servo_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/diagnosis/servo_blind.hpp"
#include "dynid/effect/servo_effects.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

Robot servo_panda() { return with_random_servos(test::panda(), 3); }

Trajectory commands_of(const Robot& robot, double duration = 8.0) {
  RandomMotionOptions options;
  options.rate = 100.0;
  options.base_frequency = 0.125;
  options.harmonics = 4;
  return random_motion(robot, duration, 5, options);
}

SimulateServosOptions clean() {
  SimulateServosOptions options;
  options.encoder_step = options.noise = 0.0;
  return options;
}

Eigen::VectorXd mean_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().colwise().mean().transpose();
}

TEST(ServoPlant, MovesAsAReplayDoes) {
  const Robot robot = servo_panda();
  const ServoRun run = simulate_servos(robot, {}, commands_of(robot), clean());
  const ServoReplay replay = replay_servos(robot, run.log, 40);
  EXPECT_GT(mean_difference(run.log.u, run.log.q).minCoeff(), 0.01);
  EXPECT_LT(replay.error.maxCoeff(), 3e-4) << replay.error.transpose();
}

// Each effect of servos, in the plant and in the replay of a model that has it in its servos.
TEST(ServoPlant, EffectsAreThoseOfTheServo) {
  const Robot robot = servo_panda();
  const Trajectory motion = commands_of(robot);
  const Eigen::MatrixXd healthy = simulate_servos(robot, {}, motion, clean()).q;
  for (const char* text : {"servo_stiffness:joints=2,factor=0.6", "servo_damping:joints=2,coefficient=60",
                           "command_delay:joints=2,delay=0.037", "command_filter:joints=2,time_constant=0.05",
                           "encoder_offset:joints=2,offset=0.03"}) {
    const Effect effect = parse_servo_effect(text, robot);
    const ServoRun run = simulate_servos(robot, {effect}, motion, clean());
    const Eigen::VectorXd changed = mean_difference(run.q, healthy);
    Eigen::Index most = 0;
    EXPECT_GT(changed.maxCoeff(&most), 2e-3) << text;
    EXPECT_EQ(most, 1) << text;
    Robot model = robot;
    ASSERT_TRUE(enter_servo(model, effect));
    const Eigen::VectorXd left = replay_servos(model, run.log, 40).error;
    EXPECT_LT(left.maxCoeff(), 5e-4) << text << ": " << left.transpose();
  }
}

// Of all that the servo gives, as friction with the load is in a torque log: under the load it is more on the
// way up than on the way down.
TEST(ServoPlant, FrictionWithTheLoadIsOfAllThatTheServoGives) {
  Robot robot = servo_panda();
  const Trajectory motion = commands_of(robot);
  const Eigen::MatrixXd healthy = simulate_servos(robot, {}, motion, clean()).q;
  robot.joints[1].servo->load_friction = 0.3;
  const ServoRun run = simulate_servos(robot, {}, motion, clean());
  const double changed = mean_difference(run.q, healthy)[1];
  EXPECT_GT(changed, 3e-3);
  const Eigen::VectorXd left = replay_servos(robot, run.log, 40).error;
  EXPECT_LT(left.maxCoeff(), 0.1 * changed) << left.transpose();
}

TEST(ServoPlant, LimitHoldsAndGravityIsCompensated) {
  const Robot robot = servo_panda();
  const Trajectory motion = commands_of(robot);
  const ServoRun free = simulate_servos(robot, {}, motion, clean());
  const double limit = 0.6 * free.tau.col(1).cwiseAbs().maxCoeff();
  const ServoRun limited = simulate_servos(
      robot, {parse_servo_effect("torque_saturation:joints=2,limit=" + std::to_string(limit), robot)}, motion,
      clean());
  const double damped = robot.joints[1].servo->kd * limited.dq.col(1).cwiseAbs().maxCoeff();
  EXPECT_LE(limited.tau.col(1).cwiseAbs().maxCoeff(), limit + damped);
  EXPECT_GT(mean_difference(limited.q, free.q)[1], 1e-3);
  // A servo that carries its load bends no more under it: what is left is the lag.
  const ServoRun carried =
      simulate_servos(robot, {parse_servo_effect("gravity_compensation:part=1", robot)}, motion, clean());
  EXPECT_LT(mean_difference(carried.q, carried.log.u)[1], 0.8 * mean_difference(free.q, free.log.u)[1]);
}

// Bodies, stiffness and friction times eight move alike; a servo known in ratios moves as one in SI without a
// body does.
TEST(ServoPlant, KnowsNoTorque) {
  const Robot robot = servo_panda();
  Robot heavy = robot;
  for (Joint& joint : heavy.joints) {
    joint.parameters *= 8.0;
    joint.rotor_inertia *= 8.0;
    joint.servo->kp *= 8.0, joint.servo->kd *= 8.0;
    joint.friction.linear.viscous *= 8.0, joint.friction.linear.coulomb *= 8.0;
  }
  const Trajectory motion = commands_of(robot);
  EXPECT_LT(mean_difference(simulate_servos(robot, {}, motion, clean()).q,
                            simulate_servos(heavy, {}, motion, clean()).q)
                .maxCoeff(),
            1e-6);
  Robot ratios = robot, bare = robot;
  bare.gravity.setZero();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    Servo& s = *ratios.joints[j].servo;
    s.natural_frequency = 20.0, s.damping_ratio = 0.8, s.coulomb_position = 0.004;
    s.kp = s.kd = 0.0;
    Joint& joint = bare.joints[j];
    joint.parameters.setZero();
    joint.rotor_inertia = 2.0;
    joint.friction = {};
    joint.friction.linear.coulomb = 0.004 * 800.0;
    joint.servo->kp = 800.0, joint.servo->kd = 2.0 * 0.8 * 20.0 * 2.0;
  }
  EXPECT_LT(mean_difference(simulate_servos(ratios, {}, motion, clean()).q,
                            simulate_servos(bare, {}, motion, clean()).q)
                .maxCoeff(),
            1e-4);
}

TEST(ServoPlant, IsTheSameForASeedAndAnEncodersSteps) {
  const Robot robot = servo_panda();
  const Trajectory motion = commands_of(robot, 3.0);
  SimulateServosOptions options;
  options.seed = 7;
  const Log a = simulate_servos(robot, {}, motion, options).log,
            b = simulate_servos(robot, {}, motion, options).log;
  EXPECT_EQ(a.q, b.q);
  options.seed = 8;
  EXPECT_NE(a.q, simulate_servos(robot, {}, motion, options).log.q);
  for (Eigen::Index i = 0; i < a.q.rows(); ++i) {
    const double steps = a.q(i, 0) / options.encoder_step;
    EXPECT_NEAR(steps, std::round(steps), 1e-6);
  }
  EXPECT_EQ(a.tau.size(), 0);
  options.record_torque = true;
  EXPECT_EQ(simulate_servos(robot, {}, motion, options).log.tau.rows(), a.q.rows());
}

TEST(ServoPlant, SaysWhatIsWrong) {
  const Robot robot = servo_panda();
  const Trajectory motion = commands_of(robot, 2.0);
  const auto refused = [&](const Robot& other, const char* what) {
    try {
      simulate_servos(other, {}, motion, {});
      ADD_FAILURE() << "not refused: " << what;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  Robot other = robot;
  other.joints[3].servo.reset();
  refused(other, other.joints[3].name.c_str());
  other = robot;
  other.joints[3].servo->kp = 0.0;
  other.joints[3].servo->natural_frequency = 20.0;
  refused(other, "ratios only");
  other = robot;
  other.joints.pop_back();
  refused(other, "7 joints");
  EXPECT_THROW(parse_servo_effect("servo_stiffness:joints=9", robot), Error);
  EXPECT_THROW(parse_servo_effect("command_delay:joints=1,delay=-1", robot), Error);
  EXPECT_THROW(parse_servo_effect("servo_stiffness:stiff=2", robot), Error);
  Robot without = robot;
  without.joints[0].servo.reset();
  EXPECT_THROW(parse_servo_effect("command_delay:joints=1", without), Error);
}

}  // namespace
}  // namespace dynid
