// SPDX-License-Identifier: Apache-2.0
// What the simulated arm is made of, without a master: its clock, its commands, its reference, the arm
// itself.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/simulate.hpp"
#include "ros/plant_arm.hpp"
#include "ros/plant_clock.hpp"
#include "ros/plant_command.hpp"
#include "ros/plant_reference.hpp"
#include "simulation/robots.hpp"

namespace dynid::test {
namespace {

using Eigen::VectorXd;

// ------------------------------------------------------------------------------------------------------
// clock

TEST(PlantClock, LosesNoCycleAndMakesNoBurst) {
  constexpr double period = 1e-3;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    std::exponential_distribution<double> small(1.0 / 2e-4), large(1.0 / 0.05);
    std::bernoulli_distribution rare(0.01);
    PlantClock clock(period, 0.0);
    double now = 0.0, last = -1.0;
    long run = 0;
    for (int k = 0; k < 5000; ++k) {
      const double wake = clock.wake();
      ASSERT_GE(wake, last + 0.5 * period - 1e-12) << "seed " << seed;
      now = std::max(now, wake) + (rare(random) ? std::min(0.9, large(random)) : small(random));
      run += clock.begin(now) + 1;
      ASSERT_LE(clock.due(), now + 1e-12) << "seed " << seed;
      ASSERT_LE(now - clock.due(), PlantClock::longest_lag + 1e-9) << "seed " << seed;
      ASSERT_NEAR(clock.due(), double(run) * period, 1e-9) << "seed " << seed;  // time and cycles agree
      last = now;
    }
    const PlantClock::Statistics& s = clock.statistics();
    EXPECT_EQ(s.cycles, 5000);
    EXPECT_EQ(s.cycles + s.missed, run);
    EXPECT_GT(s.late, 0);
    EXPECT_GT(s.missed, 0);
    EXPECT_EQ(s.stalls, 0);
    EXPECT_GT(s.worst, PlantClock::longest_lag);
  }
}

TEST(PlantClock, CatchesUpAtTwiceTheRate) {
  PlantClock clock(1e-3, 0.0);
  EXPECT_EQ(clock.begin(0.011), 0);  // 10 ms late
  int cycles = 1;
  double now = 0.011;
  while (now - clock.due() > 1e-9 && cycles < 1000) {
    now = clock.wake();
    EXPECT_EQ(clock.begin(now), 0);
    ++cycles;
  }
  EXPECT_NEAR(now, 0.021, 1e-3);
  EXPECT_EQ(clock.statistics().missed, 0);
}

TEST(PlantClock, StandsStillInALongStall) {
  PlantClock clock(1e-3, 0.0);
  EXPECT_EQ(clock.begin(5.0), 0);
  EXPECT_EQ(clock.due(), 5.0);
  EXPECT_NEAR(clock.wake(), 5.001, 1e-12);
  EXPECT_EQ(clock.statistics().stalls, 1);
  EXPECT_EQ(clock.statistics().missed, 0);
}

// ---------------------------------------------------------------------------------------------------
// commands

VectorXd held() { return (VectorXd(7) << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785).finished(); }

/// Rest to rest in `duration` by the quintic, joint names in reverse, `count` points.
trajectory_msgs::JointTrajectory rest_to_rest(const Robot& robot, const VectorXd& from, const VectorXd& to,
                                              double duration, int count, bool derivatives) {
  trajectory_msgs::JointTrajectory command;
  for (auto joint = robot.joints.rbegin(); joint != robot.joints.rend(); ++joint)
    command.joint_names.push_back(joint->name);
  for (int i = 0; i < count; ++i) {
    const double u = double(i) / (count - 1), s = u * u * u * (10 - 15 * u + 6 * u * u),
                 ds = 30 * u * u * (1 - u) * (1 - u) / duration,
                 dds = 60 * u * (1 - u) * (1 - 2 * u) / (duration * duration);
    trajectory_msgs::JointTrajectoryPoint point;
    point.time_from_start.fromSec(u * duration);
    for (int j = 6; j >= 0; --j) {
      point.positions.push_back(from[j] + s * (to[j] - from[j]));
      if (!derivatives) continue;
      point.velocities.push_back(ds * (to[j] - from[j]));
      point.accelerations.push_back(dds * (to[j] - from[j]));
    }
    command.points.push_back(point);
  }
  return command;
}

TEST(PlantCommand, BringsJointsIntoTheRobotsOrder) {
  const Robot robot = panda();
  const VectorXd from = held(), to = from + VectorXd::LinSpaced(7, 0.1, 0.7);
  const Trajectory motion = motion_from(rest_to_rest(robot, from, to, 2.0, 21, true), robot, from, 0.01);
  ASSERT_EQ(motion.samples(), 21);
  EXPECT_LT((motion.q.row(0).transpose() - from).norm(), 1e-12);
  EXPECT_LT((motion.q.row(20).transpose() - to).norm(), 1e-12);
  EXPECT_NEAR(motion.t[20], 2.0, 1e-9);
}

TEST(PlantCommand, LeftOutDerivativesAreThoseOfThePositions) {
  const Robot robot = panda();
  const VectorXd from = held(), to = from + VectorXd::LinSpaced(7, 0.1, 0.7);
  const Trajectory full = motion_from(rest_to_rest(robot, from, to, 2.0, 201, true), robot, from, 0.01),
                   bare = motion_from(rest_to_rest(robot, from, to, 2.0, 201, false), robot, from, 0.01);
  EXPECT_LT((full.dq - bare.dq).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_LT((full.ddq - bare.ddq).cwiseAbs().maxCoeff(), 2e-2);
}

TEST(PlantCommand, AGoalAloneIsReachedFromWhereTheArmIs) {
  const Robot robot = panda();
  VectorXd to = held();
  to[3] += 0.4;
  trajectory_msgs::JointTrajectory command = rest_to_rest(robot, held(), to, 2.0, 2, false);
  command.points.erase(command.points.begin());
  const Trajectory motion = motion_from(command, robot, held(), 0.01);
  ASSERT_EQ(motion.samples(), 2);
  VectorXd q(7), dq(7), ddq(7);
  sample(motion, 1.0, q, dq, ddq);
  EXPECT_NEAR(q[3], held()[3] + 0.2, 1e-12);
  EXPECT_NEAR(dq[3], 0.4 * 15.0 / 8.0 / 2.0, 1e-12);  // the quintic's
}

TEST(PlantCommand, RefusesAndSaysWhy) {
  const Robot robot = panda();
  VectorXd to = held();
  to[0] += 0.3;
  const trajectory_msgs::JointTrajectory good = rest_to_rest(robot, held(), to, 2.0, 11, true);
  EXPECT_NO_THROW(motion_from(good, robot, held(), 0.01));
  const auto complaint = [&](const auto& change) -> std::string {
    trajectory_msgs::JointTrajectory command = good;
    change(command);
    try {
      motion_from(command, robot, held(), 0.01);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  using Command = trajectory_msgs::JointTrajectory;
  const std::pair<std::string, std::string> cases[] = {
      {complaint([](Command& c) { c.points.clear(); }), "there are no points"},
      {complaint([](Command& c) { c.joint_names[2] = "elbow"; }), "joint 'panda_joint5' is missing"},
      {complaint([](Command& c) { c.joint_names.push_back("elbow"); }),
       "joint 'elbow' is not one of the robot's"},
      {complaint([](Command& c) { c.joint_names.push_back("panda_joint2"); }),
       "joint 'panda_joint2' is named twice"},
      {complaint([](Command& c) { c.points[3].positions.pop_back(); }), "point 4: 6 positions for 7 joints"},
      {complaint([](Command& c) { c.points[3].velocities.clear(); }), "point 4: 0 velocities for 7 joints"},
      {complaint([](Command& c) { c.points[0].accelerations.clear(); }),
       "some points have accelerations and others have none"},
      {complaint([](Command& c) { c.points[5].positions[6] = NAN; }),
       "point 6: positions of joint 'panda_joint1' are not finite"},
      {complaint([](Command& c) { std::swap(c.points[2].time_from_start, c.points[3].time_from_start); }),
       "point 4: time_from_start does not increase"},
      {complaint([](Command& c) { c.points[0].positions[6] += 0.02; }),
       "joint 'panda_joint1': the motion starts at 0.02, the arm is at 0"},
      {complaint([](Command& c) { c.points[0].velocities[6] = 0.1; }),
       "joint 'panda_joint1': the motion does not start at rest"},
      {complaint([](Command& c) { c.points[10].velocities[6] = 0.1; }),
       "joint 'panda_joint1': the motion does not end at rest"},
  };
  for (const auto& [said, expected] : cases) EXPECT_EQ(said, expected);
  to[0] = 3.0;
  const auto refusal = [&](double duration) -> std::string {
    try {
      motion_from(rest_to_rest(robot, held(), to, duration, 11, true), robot, held(), 0.01);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_NE(refusal(10.0).find("joint 'panda_joint1': position 2.89"), std::string::npos) << refusal(10.0);
  to[0] = 2.5;
  EXPECT_NE(refusal(1.5).find("joint 'panda_joint1': velocity"), std::string::npos) << refusal(1.5);
  to[0] = 0.6;
  EXPECT_NE(refusal(0.45).find("joint 'panda_joint1': acceleration"), std::string::npos) << refusal(0.45);
}

// --------------------------------------------------------------------------------------------------
// reference

struct Followed {
  double jump_q = 0.0, jump_dq = 0.0, ddq = 0.0;  // largest step of q and dq a millisecond, largest ddq
  double slope = 0.0;                             // largest difference of dq and the difference of q
};

Followed follow(PlantReference& reference, double from, double to, VectorXd& q) {
  Followed f;
  VectorXd dq(7), ddq(7), before(7), dbefore(7);
  reference.at(from, before, dbefore, ddq);
  for (double t = from + 1e-3; t < to; t += 1e-3) {
    reference.at(t, q, dq, ddq);
    f.jump_q = std::max(f.jump_q, (q - before).cwiseAbs().maxCoeff());
    f.jump_dq = std::max(f.jump_dq, (dq - dbefore).cwiseAbs().maxCoeff());
    f.ddq = std::max(f.ddq, ddq.cwiseAbs().maxCoeff());
    f.slope = std::max(f.slope, ((q - before) / 1e-3 - 0.5 * (dq + dbefore)).cwiseAbs().maxCoeff());
    before = q, dbefore = dq;
  }
  return f;
}

TEST(PlantReference, GoesFromWhereItIsToTheEndWithoutAJump) {
  const Robot robot = panda();
  VectorXd to = held();
  to[1] += 0.5;
  Trajectory motion = motion_from(rest_to_rest(robot, held(), to, 2.0, 41, true), robot, held(), 0.01);
  // The arm rests a little beside the motion's start.
  PlantReference reference(held() + VectorXd::Constant(7, 0.02));
  EXPECT_FALSE(reference.moving());
  reference.begin(motion, 1.0);
  EXPECT_TRUE(reference.moving());
  VectorXd q(7);
  const Followed f = follow(reference, 0.0, 4.0, q);
  EXPECT_FALSE(reference.moving());
  EXPECT_LT((q - to).norm(), 1e-12);
  EXPECT_LT((reference.held() - to).norm(), 1e-12);
  EXPECT_LT(f.jump_q, 1e-3);
  EXPECT_LT(f.jump_dq, 2e-3);
  EXPECT_LT(f.slope, 1e-4);
  EXPECT_GT(f.ddq, 0.5);
  EXPECT_LT(f.ddq, 1.5);
}

TEST(PlantReference, StopsOnThePath) {
  const Robot robot = panda();
  VectorXd to = held();
  to[1] += 0.5;
  Trajectory motion = motion_from(rest_to_rest(robot, held(), to, 2.0, 41, true), robot, held(), 0.01);
  const Trajectory path = motion;
  PlantReference reference(held());
  reference.begin(motion, 0.0);
  VectorXd q(7), on_path(7), dq(7), ddq(7);
  const Followed before = follow(reference, 0.0, 1.0, q);
  reference.stop(1.0);
  const Followed f = follow(reference, 1.0, 2.0, q);
  EXPECT_FALSE(reference.moving());
  EXPECT_LT(f.jump_q, 1e-3);
  EXPECT_LT(f.jump_dq, 6e-3);
  EXPECT_LT(f.slope, 1e-4);
  EXPECT_GT(before.ddq, 0.0);
  sample(path, 1.0 + 0.5 * PlantReference::stopping, on_path, dq, ddq);
  EXPECT_LT((q - on_path).norm(), 1e-9);
  EXPECT_LT((reference.held() - q).norm(), 1e-15);
}

TEST(PlantReference, ForgetsAMotionThatHasNotBegun) {
  const Robot robot = panda();
  VectorXd to = held();
  to[1] += 0.5;
  Trajectory motion = motion_from(rest_to_rest(robot, held(), to, 2.0, 41, true), robot, held(), 0.01);
  PlantReference reference(held());
  reference.begin(motion, 5.0);
  reference.stop(1.0);
  EXPECT_FALSE(reference.moving());
  VectorXd q(7), dq(7), ddq(7);
  reference.at(6.0, q, dq, ddq);
  EXPECT_EQ(q, held());
}

// --------------------------------------------------------------------------------------------------------
// arm

TEST(PlantArm, HoldsALoadThatItDoesNotKnowAndFollowsAMotion) {
  const Robot robot = panda();
  PlantArmOptions options;
  options.effects = {parse_effect("payload:mass=2,com=0.02:0:0.08", robot)};
  PlantArm arm(robot, held(), options);
  for (int k = 0; k < 3000; ++k) arm.step();
  EXPECT_LT((arm.plant().q() - held()).cwiseAbs().maxCoeff(), 2e-3);
  VectorXd to = held();
  to[1] += 0.5, to[3] += 0.4, to[5] += 0.3;
  Trajectory motion = motion_from(rest_to_rest(robot, held(), to, 2.0, 41, true), robot, held(), 0.01);
  arm.begin(motion, 0.0);
  VectorXd q(7), dq(7), ddq(7);
  double astray = 0.0;
  int moving = 0;
  for (; arm.reference().moving() && moving < 5000; ++moving) {
    arm.step();
    astray = std::max(astray, (arm.plant().q() - arm.reference().held()).cwiseAbs().maxCoeff());
  }
  EXPECT_NEAR(moving, 2001, 2);
  EXPECT_GT(astray, 0.4);  // it did move
  for (int k = 0; k < 2000; ++k) arm.step();
  EXPECT_LT((arm.plant().q() - to).cwiseAbs().maxCoeff(), 2e-3);
}

TEST(PlantArm, MeasuresAsDynidSimulateDoes) {
  const Robot robot = panda();
  const std::vector<Effect> effects = {parse_effect("payload:mass=1.5,com=0.02:0:0.08", robot),
                                       parse_effect("torque_offset:joints=2,offset=0.4", robot)};
  VectorXd to = held();
  to[1] += 0.5, to[3] += 0.4, to[5] += 0.3;
  Trajectory motion = motion_from(rest_to_rest(robot, held(), to, 2.0, 41, true), robot, held(), 0.01);
  SimulateOptions simulated;
  simulated.measurement = MeasurementOptions::realistic(0.7);
  simulated.measurement.stamp_jitter = simulated.measurement.repeat_probability = 0.0;  // of the network
  simulated.spread = 0.02;
  simulated.seed = 5;
  const Log log = simulate(robot, effects, motion, simulated).log;
  PlantArmOptions options;
  options.effects = effects;
  options.noise = 0.7, options.spread = 0.02, options.seed = 5;
  PlantArm arm(robot, held(), options);
  arm.begin(motion, 0.0);
  const double turn = 2.0 * M_PI / double(1 << 20);  // one count, where the two round differently
  for (Eigen::Index k = 0; k < log.samples(); ++k) {
    ASSERT_LT((arm.plant().measured_q() - log.q.row(k).transpose()).cwiseAbs().maxCoeff(), 2.0 * turn) << k;
    ASSERT_LT((arm.plant().measured_tau() - log.tau.row(k).transpose()).cwiseAbs().maxCoeff(), 0.05) << k;
    arm.step();
  }
}

TEST(PlantArm, APushIsInTheEfforts) {
  // At rest the motors give what the push does not: tau = g - J^T F.
  const Robot robot = panda();
  const Model<> model(robot);
  Workspace<> ws(model);
  for (const bool tip_axes : {false, true}) {
    PlantArmOptions options;
    options.noise = 0.0;
    options.push_timeout = 4.0;
    PlantArm arm(robot, held(), options);
    for (int k = 0; k < 3000; ++k) arm.step();
    const VectorXd before = arm.plant().measured_tau();
    Eigen::Matrix<double, 6, 1> wrench, in_base;
    wrench << 10, -5, 8, 0.5, -0.3, 0.2;
    arm.push(wrench, tip_axes);
    for (int k = 0; k < 3500; ++k) arm.step();
    std::vector<Eigen::Isometry3d> poses(8);
    forward_kinematics(model, ws, arm.plant().q(), poses);
    Eigen::MatrixXd J(6, 7);
    jacobian(model, ws, arm.plant().q(), robot.tip, J);
    in_base = wrench;
    if (tip_axes) in_base << poses[7].linear() * wrench.head<3>(), poses[7].linear() * wrench.tail<3>();
    const VectorXd felt = before - arm.plant().measured_tau(), torque = J.transpose() * in_base;
    EXPECT_LT((felt - torque).norm(), 0.05 * torque.norm()) << "tip axes " << tip_axes;
    // The time-out takes it away by itself.
    for (int k = 0; k < 4000; ++k) arm.step();
    EXPECT_LT((arm.plant().measured_tau() - before).norm(), 0.05 * torque.norm()) << "tip axes " << tip_axes;
  }
}

TEST(PlantArm, IsLostRatherThanWrong) {
  const Robot robot = panda();
  PlantArm arm(robot, held(), {});
  Eigen::Matrix<double, 6, 1> wrench = Eigen::Matrix<double, 6, 1>::Constant(NAN);
  arm.push(wrench, false);  // no harm
  for (int k = 0; k < 10; ++k) arm.step();
  wrench << 1000, 1000, 1000, 0, 0, 0;
  EXPECT_THROW(
      for (int k = 0; k < 1000; ++k) {
        arm.push(wrench, false);
        arm.step();
      },
      Error);
  EXPECT_THROW(PlantArm(robot, VectorXd::Zero(6), {}), Error);
}

}  // namespace
}  // namespace dynid::test
