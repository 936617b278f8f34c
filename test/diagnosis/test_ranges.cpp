// SPDX-License-Identifier: Apache-2.0
// Laws of the ranges in which the diagnosis searches: what a robot of the family may have lies within them,
// and they follow the arm and the log.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/family.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

TEST(Ranges, TheGridOfAParameterEndsWhereItsRangeDoes) {
  const ShapeParameter linear{"a", "s", -1.0, 3.0, 5, false}, logarithmic{"b", "s", 0.1, 10.0, 5, true},
      both{"c", "s", -2.0, 2.0, 21, true};
  for (const ShapeParameter& p : {linear, logarithmic, both}) {
    EXPECT_DOUBLE_EQ(p.at(0.0), p.low) << p.key;
    EXPECT_DOUBLE_EQ(p.at(1.0), p.high) << p.key;
    double before = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < p.points; ++k) {
      const double step = 1.0 / (p.points - 1), x = p.at(k * step);
      EXPECT_GT(x, before) << p.key;
      before = x;
      const auto [low, high] = p.beside(x);
      EXPECT_NEAR(low, k > 0 ? p.at((k - 1) * step) : p.low, 1e-9) << p.key << " at " << x;
      EXPECT_NEAR(high, k + 1 < p.points ? p.at((k + 1) * step) : p.high, 1e-9) << p.key << " at " << x;
      EXPECT_GT(p.size_at(x), 0.0) << p.key;
    }
  }
  EXPECT_EQ(both.at(0.5), 0.0);
  EXPECT_NEAR(both.at(0.55), 0.02 * std::pow(100.0, 0.1), 1e-12);  // two decades below the end, a step up
}

TEST(Ranges, HoldWhatRobotsOfTheFamilyHave) {
  constexpr double recorded = 20.0;  // [s], as draw_family_effect() takes it
  constexpr double beyond = 2.0;     // a factor that a fit of the rest hardly shows
  constexpr double carries = 1e-6;   // of the arm's largest torque
  constexpr double holds = 1e-3;     // of what the joint carries as it moves
  int checked = 0;
  for (unsigned long seed = 1; seed <= 60; ++seed) {
    const Robot robot = random_family_robot(seed);
    std::vector<JointScale> scales = joint_scales(robot);
    double largest = 0.0;
    for (JointScale& s : scales) s.recorded = recorded, largest = std::max(largest, s.torque);
    for (const EffectSchema& schema : effect_schemas()) {
      // Pairs of joints of one type are few; a body has no shape.
      if (schema.name == "gear_coupling" || schema.name == "payload" || schema.name == "link_inertial_error")
        continue;
      const Effect effect = draw_family_effect(schema.name, robot, 31 * seed + 7, 1.0, recorded);
      const Hypothesis* const h = find_hypothesis(effect);
      ASSERT_NE(h, nullptr) << schema.name;
      for (int unit = 0; unit < h->units(robot); ++unit) {
        const std::vector<int> joints = h->joints(robot, unit);
        if (h->scope() == Scope::joint &&
            (std::count(effect.joints.begin(), effect.joints.end(), joints.front()) == 0 ||
             scales[static_cast<std::size_t>(unit)].torque < carries * largest))
          continue;
        // A limit is drawn as a part of what the joint holds, which may be nothing.
        if (schema.name == "torque_saturation" && scales[static_cast<std::size_t>(unit)].gravity <
                                                      holds * scales[static_cast<std::size_t>(unit)].torque)
          continue;
        if (h->scope() == Scope::window && joints.back() != effect.joints.back()) continue;
        Eigen::VectorXd c, shape;
        h->restore(robot, effect, unit, c, shape);
        const std::vector<ShapeParameter> searched = h->shape_of(unit, scales, arm_reach(robot));
        ASSERT_EQ(static_cast<std::size_t>(shape.size()), searched.size()) << schema.name;
        for (std::size_t k = 0; k < searched.size(); ++k) {
          const ShapeParameter& p = searched[k];
          if (p.key == "stiffness") continue;  // of play: stiffer ones look alike (backlash.cpp)
          const double x = shape[static_cast<Eigen::Index>(k)];
          EXPECT_LE(x, p.high > 0.0 ? beyond * p.high : p.high / beyond)
              << schema.name << " " << p.key << ", seed " << seed;
          EXPECT_GE(x, p.low < 0.0 ? beyond * p.low : p.low / beyond)
              << schema.name << " " << p.key << ", seed " << seed;
          ++checked;
        }
      }
    }
  }
  EXPECT_GT(checked, 1000);
}

TEST(Ranges, ADriftIsSoughtAsSlowAsTheLogIsLong) {
  const Robot robot = random_family_robot(3);
  for (const auto& h : hypotheses()) {
    if (h->name() != "thermal_friction_drift") continue;
    std::vector<JointScale> scales = joint_scales(robot);
    const auto range = [&](double recorded) {
      for (JointScale& s : scales) s.recorded = recorded;
      return h->shape_of(0, scales, arm_reach(robot)).front();
    };
    EXPECT_NEAR(range(3600.0).high, 180.0 * range(20.0).high, 1e-6 * range(3600.0).high) << h->form();
    EXPECT_NEAR(range(3600.0).low, 180.0 * range(20.0).low, 1e-6 * range(3600.0).high) << h->form();
  }
}

/// Two logs of a robot that has the effect, with sensors as its size has them.
std::vector<Log> family_logs(const Robot& robot, const std::string& effect, double duration, double rate) {
  std::vector<Log> logs;
  for (unsigned long seed : {41, 42}) {
    FamilyRun run;
    run.duration = duration;
    run.rate = rate;
    run.control_rate = 1000.0;
    SimulateOptions options;
    options.measurement = MeasurementOptions::realistic();
    options.measurement.correlated_noise = 0.0;
    options.rate = rate;
    options.control_rate = run.control_rate;
    options.seed = seed;
    options.record_torques = false;
    logs.push_back(
        simulate(robot, {parse_effect(effect, robot)}, family_motion(robot, run, seed), options).log);
  }
  return logs;
}

/// The first robot of the family from `seed` on that has one to three joints, all of which sweep their travel
/// in less than, or more than, `time` [s].
Robot family_robot(unsigned long seed, bool quick, double time) {
  for (;; ++seed) {
    Robot robot = random_family_robot(seed);
    const std::vector<JointScale> scales = joint_scales(robot);
    if (robot.size() <= 3 && std::all_of(scales.begin(), scales.end(),
                                         [&](const JointScale& s) { return (s.duration() < time) == quick; }))
      return robot;
  }
}

// A filter's delay is nothing to the arm: a small quick one is far along while it lasts.
TEST(Ranges, ADelayOfASmallQuickArmIsFound) {
  const Robot robot = family_robot(1, true, 0.5);
  DiagnoseOptions options;
  options.replay = false;
  const Diagnosis d = diagnose(robot, family_logs(robot, "time_delay:delay_s=0.03", 10.0, 500.0), options);
  ASSERT_FALSE(d.effects.empty()) << to_string(d.verdict);
  EXPECT_EQ(d.effects.front().effect.name, "time_delay");
  EXPECT_NEAR(d.effects.front().effect.parameters.at("delay_s").at(0), 0.03, 0.001);
  EXPECT_EQ(d.effects.size(), 1U);
}

// A motor warms in minutes.
TEST(Ranges, ADriftOfMinutesIsFound) {
  const Robot robot = family_robot(1, false, 0.5);
  DiagnoseOptions options;
  options.replay = false;
  const JointScale scale = joint_scales(robot)[0];
  const std::string effect =
      "thermal_friction_drift:joints=1,time_constant=80,reference_speed=0,coefficient=" +
      std::to_string(0.2 * scale.torque / scale.speed);
  const Diagnosis d = diagnose(robot, family_logs(robot, effect, 120.0, 100.0), options);
  ASSERT_FALSE(d.effects.empty()) << to_string(d.verdict);
  EXPECT_EQ(d.effects.front().effect.name, "thermal_friction_drift");
  EXPECT_NEAR(d.effects.front().effect.parameters.at("time_constant").at(0), 80.0, 25.0);
}

}  // namespace
}  // namespace dynid
