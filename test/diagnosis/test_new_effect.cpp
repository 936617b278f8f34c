// SPDX-License-Identifier: Apache-2.0
//
// An effect that the library does not have, written here alone as an effect is written: the diagnosis takes
// it through DiagnoseOptions::extra, beside all of its own, without knowing it.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "diagnosis/effects/effects.hpp"
#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#include "simulation/robots.hpp"

namespace dynid {
namespace {

/// c |dq| dq: what a joint churns oil with.
class QuadraticFriction : public detail::OwnTorque {
 public:
  QuadraticFriction() : OwnTorque("quadratic_friction", {{"coefficient", "N m s^2/rad^2"}}) {}

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int joint, const Eigen::VectorXd&) const override {
    return motion.speed.col(joint).array() * motion.speed.col(joint).array().abs();
  }
};

/// Of a Panda that has it on joint 2.
std::vector<Log> logs_with(const Robot& robot, double coefficient) {
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.measurement.correlated_noise = 0.0;
  options.rate = 250.0;
  options.record_torques = false;
  std::vector<Log> logs;
  for (unsigned long seed : {31, 32}) {
    options.seed = seed;
    logs.push_back(simulate(robot, {}, random_motion(robot, 8.0, seed), options).log);
    const Eigen::ArrayXd speed = logs.back().dq.col(1).array();
    logs.back().tau.col(1).array() += coefficient * speed * speed.abs();
  }
  return logs;
}

TEST(NewEffect, IsNamedWithoutBeingInTheCatalogue) {
  ASSERT_EQ(find_effect_schema("quadratic_friction"), nullptr);
  const Robot robot = test::panda();
  const QuadraticFriction effect;
  DiagnoseOptions options;
  options.replay = false;
  options.extra = {&effect};
  const Diagnosis d = diagnose(robot, logs_with(robot, 1.5), options);
  ASSERT_EQ(d.effects.size(), 1U) << to_string(d.verdict);
  const FoundEffect& found = d.effects.front();
  EXPECT_EQ(found.effect.name, "quadratic_friction");
  EXPECT_EQ(found.effect.joints, std::vector<int>{2});
  EXPECT_NEAR(found.effect.parameters.at("coefficient").at(1), 1.5, 0.08);
  EXPECT_EQ(found.parameters.front().unit, "N m s^2/rad^2");
}

}  // namespace
}  // namespace dynid
