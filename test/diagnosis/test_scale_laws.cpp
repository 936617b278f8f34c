// SPDX-License-Identifier: Apache-2.0
//
// Laws: the diagnosis knows no absolute torque or length. Robot and logs in other units of mass and of length
// have the same diagnosis, its numbers in those units; a robot twenty times as light, or with links three
// times as long, is one whose units were changed.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/effect/parse.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#include "simulation/robots.hpp"

namespace dynid {
namespace {

/// One unit of mass and of length in the new ones.
struct Units {
  double mass = 1.0, length = 1.0;

  double torque(JointType type) const {
    return type == JointType::prismatic ? mass * length : mass * length * length;
  }
  double position(JointType type) const { return type == JointType::prismatic ? length : 1.0; }
  /// Of a quantity by its unit (as EffectSchema::unit() has it); times are the same.
  double of(const std::string& unit) const {
    const double m = mass, l = length;
    const std::map<std::string, double> factors = {{"1", 1.0},
                                                   {"s", 1.0},
                                                   {"deg", 1.0},
                                                   {"rad", 1.0},
                                                   {"rad/s", 1.0},
                                                   {"1/rad", 1.0},
                                                   {"rad^2/s", 1.0},
                                                   {"N m", m * l * l},
                                                   {"N m/rad", m * l * l},
                                                   {"kg m^2", m * l * l},
                                                   {"N m s/rad", m * l * l},
                                                   {"m", l},
                                                   {"m/s", l},
                                                   {"1/m", 1.0 / l},
                                                   {"m^2/s", l * l},
                                                   {"N", m * l},
                                                   {"N/m", m},
                                                   {"N s/m", m},
                                                   {"kg", m},
                                                   {"kg m", m * l}};
    return factors.at(unit);
  }
};

Robot in_units(Robot robot, const Units& u) {
  robot.gravity *= u.length;
  robot.tip.translation() *= u.length;
  for (Joint& joint : robot.joints) {
    joint.origin.translation() *= u.length;
    joint.dh.reset();
    joint.parameters[0] *= u.mass;
    joint.parameters.segment<3>(1) *= u.mass * u.length;
    joint.parameters.tail<6>() *= u.mass * u.length * u.length;
    const double torque = u.torque(joint.type), position = u.position(joint.type);
    for (double* limit : {&joint.limits.lower, &joint.limits.upper, &joint.limits.velocity,
                          &joint.limits.acceleration, &joint.limits.jerk})
      *limit *= position;
    joint.limits.torque *= torque;
    joint.limits.torque_rate *= torque;
    joint.rotor_inertia *= torque / position;
    joint.friction.linear.viscous *= torque / position;
    joint.friction.linear.coulomb *= torque;
    joint.friction.linear.offset *= torque;
    joint.friction.linear.velocity_scale *= position;
    joint.friction.sigmoid.phi1 *= torque;
    joint.friction.sigmoid.phi2 /= position;
    joint.friction.sigmoid.phi3 *= position;
  }
  return robot;
}

std::vector<Log> in_units(std::vector<Log> logs, const Robot& robot, const Units& u) {
  for (Log& log : logs)
    for (Eigen::Index j = 0; j < log.q.cols(); ++j) {
      const JointType type = robot.joints[static_cast<std::size_t>(j)].type;
      log.q.col(j) *= u.position(type);
      log.dq.col(j) *= u.position(type);
      if (log.ddq.size() > 0) log.ddq.col(j) *= u.position(type);
      log.tau.col(j) *= u.torque(type);
    }
  return logs;
}

std::vector<Log> recorded(const Robot& robot, const std::string& effect, unsigned long seed) {
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.measurement.correlated_noise = 0.0;
  options.rate = 250.0;
  options.record_torques = false;
  std::vector<Log> logs;
  for (unsigned long k = 0; k < 2; ++k) {
    options.seed = seed + k;
    logs.push_back(
        simulate(robot, {parse_effect(effect, robot)}, random_motion(robot, 8.0, seed + k), options).log);
  }
  return logs;
}

Diagnosis diagnosed(const Robot& robot, const std::vector<Log>& logs) {
  DiagnoseOptions options;
  options.replay = false;
  return diagnose(robot, logs, options);
}

/// The same diagnosis, but for the units.
void expect_same(const Diagnosis& a, const Diagnosis& b, const Robot& robot, const Units& u) {
  EXPECT_EQ(to_string(a.verdict), std::string(to_string(b.verdict)));
  EXPECT_NEAR(a.p_value, b.p_value, 1e-9);
  EXPECT_NEAR(a.shrink.fraction, b.shrink.fraction, 1e-3);
  ASSERT_EQ(a.effects.size(), b.effects.size());
  for (std::size_t k = 0; k < a.effects.size(); ++k) {
    const FoundEffect &one = a.effects[k], &other = b.effects[k];
    SCOPED_TRACE(one.effect.name);
    EXPECT_EQ(one.effect.name, other.effect.name);
    EXPECT_EQ(one.effect.joints, other.effect.joints);
    EXPECT_NEAR(one.probability, other.probability, 0.01);
    const EffectSchema& schema = effect_schema(one.effect.name);
    for (const auto& [key, values] : one.effect.parameters) {
      const std::vector<double>& scaled = other.effect.parameters.at(key);
      ASSERT_EQ(values.size(), scaled.size());
      for (std::size_t i = 0; i < values.size(); ++i) {
        const int joint =
            schema.parameter(key).per_joint ? static_cast<int>(i) : one.effect.joints.front() - 1;
        const double expected = values[i] * u.of(schema.unit(key, robot, joint));
        EXPECT_NEAR(scaled[i], expected, 0.01 * std::abs(expected)) << key << " " << i;
      }
    }
  }
  for (Eigen::Index j = 0; j < a.rms.size(); ++j) {
    const double torque = u.torque(robot.joints[static_cast<std::size_t>(j)].type);
    EXPECT_NEAR(b.rms[j], torque * a.rms[j], 1e-6 * torque * a.rms[j]) << j;
    EXPECT_NEAR(b.floor[j], torque * a.floor[j], 1e-6 * torque * a.floor[j]) << j;
  }
}

class UnitsOfThePanda : public testing::TestWithParam<const char*> {};

TEST_P(UnitsOfThePanda, TellTheSame) {
  const Robot robot = test::panda();
  const std::string effect = GetParam();
  const std::vector<Log> logs = recorded(robot, effect, 61);
  const Diagnosis metric = diagnosed(robot, logs);
  ASSERT_FALSE(metric.effects.empty()) << to_string(metric.verdict);
  EXPECT_EQ(metric.effects.front().effect.name, effect.substr(0, effect.find(':')));
  for (const auto& [name, u] :
       {std::pair{"0.05 times the mass", Units{0.05, 1.0}}, std::pair{"8 times the mass", Units{8.0, 1.0}},
        std::pair{"3 times the length", Units{1.0, 3.0}}}) {
    SCOPED_TRACE(name);
    expect_same(metric, diagnosed(in_units(robot, u), in_units(logs, robot, u)), robot, u);
  }
}
INSTANTIATE_TEST_SUITE_P(Effects, UnitsOfThePanda,
                         testing::Values("viscous_friction:joints=2,coefficient=1.2",
                                         "torque_saturation:joints=2,limit=25"),
                         [](const auto& effect) {
                           const std::string text = effect.param;
                           return text.substr(0, text.find(':'));
                         });

TEST(ScaleLaws, APrismaticJointInMillimetresTellsTheSame) {
  const Robot robot = test::light_wrist_scara();
  const std::vector<Log> logs = recorded(robot, "viscous_friction:joints=3,coefficient=20", 71);
  const Diagnosis metric = diagnosed(robot, logs);
  ASSERT_FALSE(metric.effects.empty()) << to_string(metric.verdict);
  EXPECT_EQ(metric.effects.front().effect.name, "viscous_friction");
  EXPECT_EQ(metric.effects.front().effect.joints, std::vector<int>{3});
  const Units millimetres{1.0, 1000.0};
  expect_same(metric, diagnosed(in_units(robot, millimetres), in_units(logs, robot, millimetres)), robot,
              millimetres);
}

TEST(ScaleLaws, ASaturationOfThreeHundredNewtonMetresIsFound) {
  const Robot robot = in_units(test::panda(), {16.0, 1.0});
  const Diagnosis d = diagnosed(robot, recorded(robot, "torque_saturation:joints=2,limit=300", 81));
  ASSERT_FALSE(d.effects.empty()) << to_string(d.verdict);
  EXPECT_EQ(d.effects.front().effect.name, "torque_saturation");
  EXPECT_EQ(d.effects.front().effect.joints, std::vector<int>{2});
  EXPECT_NEAR(d.effects.front().effect.parameters.at("limit").at(1), 300.0, 6.0);
}

}  // namespace
}  // namespace dynid
