// SPDX-License-Identifier: Apache-2.0
// The family: arms that can exist, motions within their limits, effects that fit them, and runs that end
// well.
#include "dynid/simulation/family.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/simulate.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

TEST(Family, RobotsCanExistAndDiffer) {
  std::set<int> sizes;
  int sliding = 0, with_friction = 0, with_rotors = 0;
  double least = HUGE_VAL, most = 0.0;
  for (unsigned long seed = 0; seed < 300; ++seed) {
    const Robot robot = random_family_robot(seed);
    ASSERT_NO_THROW(validate(robot)) << "seed " << seed;
    ASSERT_TRUE(inconsistencies(robot).empty())
        << "seed " << seed << ": " << describe(inconsistencies(robot)[0]);
    EXPECT_EQ(robot.parameters(), random_family_robot(seed).parameters());
    sizes.insert(robot.size());
    for (const Joint& joint : robot.joints) sliding += joint.type == JointType::prismatic ? 1 : 0;
    with_friction += robot.joints[0].friction.linear.coulomb > 0.0 ? 1 : 0;
    with_rotors += robot.joints[0].rotor_inertia > 0.0 ? 1 : 0;
    const double length = robot.joints[0].origin.translation().z() / 0.3;
    least = std::min(least, length), most = std::max(most, length);
  }
  EXPECT_EQ(sizes.size(), 7u);
  EXPECT_GT(sliding, 100);
  EXPECT_GT(with_friction, 150);
  EXPECT_LT(with_friction, 270);
  EXPECT_GT(with_rotors, 120);
  EXPECT_LT(least, 0.06);
  EXPECT_GT(most, 15.0);
}

TEST(Family, MotionsKeepTheLimits) {
  for (unsigned long seed = 0; seed < 60; ++seed) {
    const Robot robot = random_family_robot(seed);
    FamilyRun run = random_family_run(seed);
    EXPECT_NEAR(run.control_rate / run.rate, std::round(run.control_rate / run.rate), 1e-12);
    run.duration = std::min(run.duration, 15.0);
    for (const FamilyMotion kind :
         {FamilyMotion::exciting, FamilyMotion::pick_and_place, FamilyMotion::slow}) {
      run.motion = kind;
      const Trajectory motion = family_motion(robot, run, seed);
      double moved = 0.0;
      for (int j = 0; j < robot.size(); ++j) {
        const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
        EXPECT_GE(motion.q.col(j).minCoeff(), limits.lower) << "seed " << seed;
        EXPECT_LE(motion.q.col(j).maxCoeff(), limits.upper) << "seed " << seed;
        EXPECT_LE(motion.dq.col(j).cwiseAbs().maxCoeff(), limits.velocity) << "seed " << seed;
        EXPECT_LE(motion.ddq.col(j).cwiseAbs().maxCoeff(), limits.acceleration) << "seed " << seed;
        moved = std::max(
            moved, (motion.q.col(j).maxCoeff() - motion.q.col(j).minCoeff()) / (limits.upper - limits.lower));
      }
      EXPECT_GT(moved, 0.02) << "seed " << seed << ", kind " << int(kind);
      EXPECT_EQ(motion.dq.row(0).cwiseAbs().maxCoeff() < 1e-6 * joint_scales(robot)[0].speed, true);
      if (kind == FamilyMotion::pick_and_place) {  // it moves, and it rests
        const auto resting = (motion.dq.rowwise().squaredNorm().array() == 0.0).count();
        EXPECT_GT(resting, motion.samples() / 20) << "seed " << seed;
        EXPECT_LT(resting, motion.samples() * 9 / 10) << "seed " << seed;
      }
    }
  }
}

TEST(Family, EffectsArePartsOfWhatTheJointsCarry) {
  // Dry friction drawn for any arm lies between a thousandth and half of the joint's torque range.
  for (unsigned long seed = 0; seed < 100; ++seed) {
    const Robot robot = random_family_robot(seed);
    const Eigen::VectorXd range = torque_ranges(robot);
    Effect effect;
    try {
      effect = draw_family_effect("coulomb_friction", robot, seed);
    } catch (const Error&) {
      continue;  // beyond what the catalogue allows
    }
    for (const int joint : effect.joints) {
      const double part =
          effect.parameters["coefficient"][static_cast<std::size_t>(joint - 1)] / range[joint - 1];
      EXPECT_GT(part, 1e-3) << "seed " << seed;
      EXPECT_LT(part, 0.5) << "seed " << seed;
    }
  }
  // On the Panda what is drawn is about what the catalogue draws.
  const Robot panda = test::panda();
  const Effect a = draw_effect("viscous_friction", panda, 5),
               b = draw_family_effect("viscous_friction", panda, 5);
  for (const int joint : a.joints) {
    const auto j = static_cast<std::size_t>(joint - 1);
    EXPECT_GT(b.parameters.at("coefficient")[j], 0.3 * a.parameters.at("coefficient")[j]);
    EXPECT_LT(b.parameters.at("coefficient")[j], 3.0 * a.parameters.at("coefficient")[j]);
  }
}

TEST(Family, EveryRobotRunsWithEffects) {
  int ran = 0, drawn = 0;
  for (unsigned long seed = 0; seed < 40; ++seed) {
    const Robot robot = random_family_robot(seed);
    FamilyRun run = random_family_run(seed);
    run.duration = 6.0;
    const Trajectory motion = family_motion(robot, run, seed);
    SimulateOptions options;
    options.rate = run.rate;
    options.control_rate = run.control_rate;
    options.measurement = MeasurementOptions::realistic();
    options.record_torques = false;
    EXPECT_NO_THROW(simulate(robot, {}, motion, options)) << "seed " << seed;
    const auto& catalogue = effect_schemas();
    try {
      const Effect effect =
          draw_family_effect(catalogue[seed % catalogue.size()].name, robot, seed, 1.0, run.duration);
      ++drawn;
      simulate(robot, {effect}, motion, options);
      ++ran;
    } catch (const Error& error) {
      std::printf("  seed %lu, %s: %s\n", seed, catalogue[seed % catalogue.size()].name.c_str(),
                  error.what());
    }
  }
  std::printf("  %d of %d ran, 40 asked for\n", ran, drawn);
  EXPECT_GE(drawn, 25);  // the rest leaves what the catalogue allows: very large or small arms
  EXPECT_GE(ran, drawn - 2);
}

TEST(Family, AVendorsModelHasNoFrictionAndBodiesThatCanExist) {
  for (unsigned long seed = 0; seed < 50; ++seed) {
    const Robot robot = random_family_robot(seed), nominal = as_a_vendor_says(robot, 0.05, seed);
    EXPECT_TRUE(inconsistencies(nominal).empty());
    for (const Joint& joint : nominal.joints) {
      EXPECT_EQ(joint.friction.linear.coulomb, 0.0);
      EXPECT_EQ(joint.rotor_inertia, 0.0);
    }
    const double off = (nominal.parameters() - robot.parameters()).norm() / robot.parameters().norm();
    EXPECT_GT(off, 1e-3);
    EXPECT_LT(off, 0.3);
  }
}

}  // namespace
}  // namespace dynid
