// SPDX-License-Identifier: Apache-2.0
// Every effect changes the log as its formula says, and none is there by default.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double duration = 8.0;

Trajectory motion() { return random_motion(test::panda(), duration, 3); }

MatrixXd torque(const Robot& robot, const SimulatedRun& run) {
  return predict_torque(robot, run.seen_q, run.seen_dq, run.seen_ddq).tau;
}

/// What the log's torque has beyond the nominal model, along the motion as perfect electronics see it.
MatrixXd residual(const SimulatedRun& run) { return run.log.tau - torque(test::panda(), run); }

/// The effect's formula, written down once more, along the true motion.
class Formula {
 public:
  Formula(const SimulatedRun& run, const Effect& effect) : run_(run), effect_(effect) {}

  MatrixXd operator()() const {
    const std::string& name = effect_.name;
    const MatrixXd &q = run_.q, &dq = run_.dq, &tau = run_.tau;
    Robot robot = test::panda();
    if (name == "payload") {
      const double m = one("mass"), r = one("radius");
      const std::vector<double>& c = effect_.parameters.at("com");
      robot = with_payload(robot, {m, {c[0], c[1], c[2]}, 0.4 * m * r * r * Eigen::Matrix3d::Identity()});
      return torque(robot, run_) - torque(test::panda(), run_);
    }
    if (name == "link_inertial_error") {
      StandardParameters& p = robot.joints[static_cast<std::size_t>(effect_.joints[0] - 1)].parameters;
      LinkInertia link = from_standard(p);
      link.mass += one("mass");
      const std::vector<double>& c = effect_.parameters.at("com");
      link.com += Eigen::Vector3d(c[0], c[1], c[2]);
      link.inertia *= 1.0 + one("inertia");
      p = to_standard(link);
      return torque(robot, run_) - torque(test::panda(), run_);
    }
    if (name == "gravity_tilt") {
      const double a = one("angle_deg") * M_PI / 180.0, b = one("direction_deg") * M_PI / 180.0;
      // Rodrigues, for gravity along -z and an axis in the x-y plane.
      robot.gravity =
          -9.81 * Eigen::Vector3d(std::sin(b) * std::sin(a), -std::cos(b) * std::sin(a), std::cos(a));
      return torque(robot, run_) - torque(test::panda(), run_);
    }
    if (name == "rotor_inertia") return run_.ddq * joints("armature").asDiagonal();
    if (name == "viscous_friction") return dq * joints("coefficient").asDiagonal();
    if (name == "coulomb_friction") return sign() * joints("coefficient").asDiagonal();
    if (name == "asymmetric_coulomb_friction")
      return sign().cwiseMax(0.0) * joints("coefficient_positive").asDiagonal() +
             MatrixXd(sign().cwiseMin(0.0) * joints("coefficient_negative").asDiagonal());
    if (name == "stribeck_friction")
      return each([&](Eigen::Index i, int j) {
        const double x = std::pow(std::abs(dq(i, j) / at("stribeck_velocity", j)), at("exponent", j));
        return at("static", j) == 0.0
                   ? 0.0
                   : at("static", j) * std::exp(-x) * std::tanh(dq(i, j) / at("velocity_scale", j));
      });
    if (name == "load_dependent_friction")
      return each([&](Eigen::Index i, int j) {
        return at("coefficient", j) == 0.0 ? 0.0
                                           : at("coefficient", j) * std::abs(tau(i, j)) *
                                                 std::tanh(dq(i, j) / at("velocity_scale", j));
      });
    if (name == "joint_spring")
      return each([&](Eigen::Index i, int j) { return at("stiffness", j) * (q(i, j) - at("rest", j)); });
    if (name == "torque_ripple")
      return each([&](Eigen::Index i, int j) {
        return at("amplitude", j) * std::sin(at("order", j) * q(i, j) + at("phase", j));
      });
    if (name == "torque_offset") return joints("offset").transpose().replicate(q.rows(), 1);
    if (name == "torque_gain") return tau * joints("gain").asDiagonal();
    if (name == "torque_saturation")
      return each([&](Eigen::Index i, int j) {
        const double limit = at("limit", j);
        return limit > 0.0 ? std::min(limit, std::max(-limit, tau(i, j))) - tau(i, j) : 0.0;
      });
    if (name == "time_delay") {
      return each([&](Eigen::Index i, int j) {
        const double own = at("channel_delay_s", j), rows = (own > 0.0 ? own : one("delay_s")) * 1000.0;
        const double from = std::max(0.0, double(i) - rows);
        const auto k = static_cast<Eigen::Index>(from);
        const double part = from - double(k);
        return (1.0 - part) * tau(k, j) + part * tau(std::min(k + 1, tau.rows() - 1), j) - tau(i, j);
      });
    }
    if (name == "encoder_offset")
      return predict_torque(robot, run_.seen_q.rowwise() + joints("offset").transpose(), run_.seen_dq,
                            run_.seen_ddq)
                 .tau -
             torque(robot, run_);
    if (name == "joint_elasticity" || name == "backlash")
      return predict_torque(robot, q, dq, run_.ddq).tau - torque(robot, run_);
    if (name == "gear_coupling") {
      const int a = effect_.joints[0] - 1, b = effect_.joints[1] - 1;
      const double r = one("ratio");
      MatrixXd sum = MatrixXd::Zero(q.rows(), q.cols());
      const VectorXd w = dq.col(a) + r * dq.col(b), dw = run_.ddq.col(a) + r * run_.ddq.col(b);
      sum.col(a) = one("viscous") * w + one("inertia") * dw +
                   one("coulomb") * (w / one("velocity_scale")).array().tanh().matrix();
      sum.col(b) = r * sum.col(a);
      return sum;
    }
    if (name == "external_contact") {
      // By the Jacobian of the arm cut off after the link.
      const auto link = static_cast<int>(one("link"));
      robot.joints.resize(static_cast<std::size_t>(link));
      const Model<> model(robot);
      Workspace<> ws(model);
      const std::vector<double>&f = effect_.parameters.at("force"), &p = effect_.parameters.at("point");
      MatrixXd sum = MatrixXd::Zero(q.rows(), q.cols()), J(6, link);
      for (Eigen::Index i = 0; i < q.rows(); ++i) {
        const double after = run_.t[i] - one("start"), before = one("duration") - after;
        if (after <= 0.0 || before <= 0.0) continue;
        const double edge = std::min({1.0, after / one("rise_time"), before / one("rise_time")});
        const VectorXd qi = q.row(i).head(link);
        jacobian(model, ws, qi, Eigen::Isometry3d(Eigen::Translation3d(p[0], p[1], p[2])), J);
        sum.row(i).head(link) = -0.5 * (1.0 - std::cos(M_PI * edge)) *
                                (J.topRows(3).transpose() * Eigen::Vector3d(f[0], f[1], f[2])).transpose();
      }
      return sum;
    }
    if (name == "presliding_hysteresis") {  // the bristle's own equation, by small explicit steps
      return each_joint([&](int j, Eigen::Index i, double& z) {
        const double s0 = at("stiffness", j), fc = at("coulomb", j);
        if (fc == 0.0) return 0.0;
        if (i > 0)
          for (int k = 0; k < 50; ++k) {
            const double v = dq(i - 1, j) + (k + 0.5) / 50.0 * (dq(i, j) - dq(i - 1, j));
            z += 2e-5 * (v - s0 * std::abs(v) * z / fc);
          }
        const double v = dq(i, j);
        return s0 * z + at("damping", j) * (v - s0 * std::abs(v) * z / fc);
      });
    }
    if (name == "thermal_friction_drift") {
      return each_joint([&](int j, Eigen::Index i, double& w) {
        if (at("coefficient", j) == 0.0) return 0.0;
        if (i > 0) {
          const double v = 0.5 * (dq(i, j) + dq(i - 1, j)) / at("reference_speed", j);
          w = std::min(1.0, w + 1e-3 * (v * v - w) / at("time_constant", j));
        }
        return at("coefficient", j) * (1.0 - w) * dq(i, j);
      });
    }
    ADD_FAILURE() << name << " has no formula in this test";
    return {};
  }

 private:
  double one(const char* key) const { return effect_.parameters.at(key).front(); }
  double at(const char* key, int j) const { return effect_.parameters.at(key)[static_cast<std::size_t>(j)]; }
  VectorXd joints(const char* key) const {
    return Eigen::Map<const VectorXd>(effect_.parameters.at(key).data(), 7);
  }
  MatrixXd sign() const {
    return each([this](Eigen::Index i, int j) {
      const double scale = at("velocity_scale", j);
      return scale > 0.0 ? std::tanh(run_.dq(i, j) / scale) : 0.0;
    });
  }
  template <class F>
  MatrixXd each(const F& f) const {
    MatrixXd x(run_.q.rows(), 7);
    for (int j = 0; j < 7; ++j)
      for (Eigen::Index i = 0; i < x.rows(); ++i) x(i, j) = f(i, j);
    return x;
  }
  template <class F>
  MatrixXd each_joint(const F& f) const {
    MatrixXd x(run_.q.rows(), 7);
    for (int j = 0; j < 7; ++j) {
      double state = 0.0;
      for (Eigen::Index i = 0; i < x.rows(); ++i) x(i, j) = f(j, i, state);
    }
    return x;
  }

  const SimulatedRun& run_;
  const Effect& effect_;
};

class EveryEffect : public ::testing::TestWithParam<std::string> {};

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const EffectSchema& spec : effect_schemas()) all.push_back(spec.name);
  return all;
}

// Default parameters on all joints, then two random draws, without noise.
TEST_P(EveryEffect, AddsWhatItsFormulaSays) {
  const Robot robot = test::panda();
  const Trajectory desired = motion();
  std::vector<Effect> cases = {parse_effect(GetParam(), robot)};
  if (GetParam() == "external_contact") cases = {parse_effect("external_contact:start=2", robot)};
  if (GetParam() == "time_delay")
    cases.push_back(parse_effect("time_delay:channel_delay_s=0.004:0.011:0:0.002:0.02:0.003:0.001", robot));
  for (unsigned long seed = 1; seed <= 2; ++seed)
    cases.push_back(draw_effect(GetParam(), robot, seed, 1.0, duration));
  double largest = 0.0;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const SimulatedRun run = simulate(robot, {cases[k]}, desired);
    const MatrixXd added = residual(run), formula = Formula(run, run.truth.effects[0])();
    ASSERT_EQ(formula.rows(), added.rows());
    // Hidden states are integrated on another grid here.
    const bool hidden = GetParam() == "presliding_hysteresis" || GetParam() == "thermal_friction_drift";
    const double tolerance = hidden ? 5e-3 : 1e-8;
    EXPECT_LT((added - formula).cwiseAbs().maxCoeff(), tolerance) << GetParam() << ", case " << k;
    EXPECT_LT((added - run.injected[0]).cwiseAbs().maxCoeff(), 1e-9) << GetParam() << ", case " << k;
    EXPECT_EQ(run.model_error.cwiseAbs().maxCoeff(), 0.0);
    largest = std::max(largest, test::rms(formula));
    // And nowhere but on its joints, where the torque is a joint's own.
    const bool own = effect_schema(GetParam()).scope == EffectScope::joints &&
                     GetParam() != "encoder_offset" && GetParam() != "joint_elasticity" &&
                     GetParam() != "backlash";
    for (int j = 0; own && j < 7; ++j) {
      if (std::count(cases[k].joints.begin(), cases[k].joints.end(), j + 1) > 0) continue;
      EXPECT_LT(added.col(j).cwiseAbs().maxCoeff(), 1e-9) << GetParam() << ", joint " << j + 1;
    }
  }
  EXPECT_GT(largest, 0.01) << GetParam() << " does nothing";
}

// The same through the electronics: what is left is the torque noise.
TEST_P(EveryEffect, IsInTheLogToWithinTheNoise) {
  const Robot robot = test::panda();
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.measurement.repeat_probability = 0.0;  // a repeated row is another instant's torque
  options.rate = 250.0;
  options.seed = 5;
  const std::string text = GetParam() == "external_contact" ? "external_contact:start=2" : GetParam();
  const SimulatedRun run = simulate(robot, {parse_effect(text, robot)}, motion(), options);
  const MatrixXd left = residual(run) - run.injected[0];
  for (int j = 0; j < 7; ++j) {
    const double scale = std::sqrt(robot.joints[static_cast<std::size_t>(j)].limits.torque / 87.0);
    const double expected = std::hypot(0.05, 0.03) * scale;
    EXPECT_NEAR(test::rms(left.col(j)), expected, 0.25 * expected) << GetParam() << ", joint " << j + 1;
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect, ::testing::ValuesIn(names()),
                         [](const auto& entry) { return entry.param; });

TEST(Effects, AreTheTwentyTwoOfTheCatalogue) {
  const char* known[] = {"payload",
                         "link_inertial_error",
                         "gravity_tilt",
                         "rotor_inertia",
                         "viscous_friction",
                         "coulomb_friction",
                         "asymmetric_coulomb_friction",
                         "stribeck_friction",
                         "load_dependent_friction",
                         "presliding_hysteresis",
                         "thermal_friction_drift",
                         "joint_spring",
                         "torque_ripple",
                         "torque_offset",
                         "torque_gain",
                         "time_delay",
                         "encoder_offset",
                         "joint_elasticity",
                         "gear_coupling",
                         "backlash",
                         "torque_saturation",
                         "external_contact"};
  EXPECT_EQ(effect_schemas().size(), 22u);
  for (const char* name : known) EXPECT_EQ(effect_schema(name).name, name);
}

TEST(Effects, NoneByDefault) {
  const SimulatedRun run = simulate(test::panda(), {}, motion());
  EXPECT_LT(residual(run).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_TRUE(run.injected.empty());
  EXPECT_EQ(run.log.q, run.q);
  EXPECT_EQ(run.log.t, run.t);
}

// A drive that stops at its limit: the joint gets no more, what was asked for is what is seen.
TEST(Effects, ALimitedDriveIsSeenByItsCommand) {
  const Robot robot = test::panda();
  const SimulatedRun free = simulate(robot, {}, motion());
  const double limit = 0.8 * free.tau.col(0).cwiseAbs().maxCoeff();
  const SimulatedRun run = simulate(
      robot, {parse_effect("torque_saturation:joints=1,command_limit=" + std::to_string(limit), robot)},
      motion());
  EXPECT_LT(run.tau.col(0).cwiseAbs().maxCoeff(), limit + 1e-6);
  EXPECT_GT(run.seen_tau.col(0).cwiseAbs().maxCoeff(), 1.05 * limit);
  EXPECT_EQ(run.tau.rightCols(6), run.seen_tau.rightCols(6));
  for (Eigen::Index i = 0; i < run.tau.rows(); ++i)
    EXPECT_NEAR(std::max(-limit, std::min(limit, run.seen_tau(i, 0))), run.tau(i, 0), 1e-5);
}

TEST(Effects, AnyNumberAtOnceAddUp) {
  Robot robot = test::panda();
  robot.effects = {parse_effect("payload", robot), parse_effect("joint_elasticity:joints=2+4", robot)};
  std::vector<Effect> more;
  for (const char* text :
       {"encoder_offset", "coulomb_friction", "backlash:joints=4", "presliding_hysteresis:joints=2+3",
        "torque_gain", "time_delay", "external_contact:start=2", "gravity_tilt", "gear_coupling"})
    more.push_back(parse_effect(text, robot));
  SimulateOptions options;
  options.spread = 0.02;
  const SimulatedRun run = simulate(robot, more, motion(), options);
  ASSERT_EQ(run.truth.effects.size(), 11u);
  MatrixXd sum = run.model_error;
  for (const MatrixXd& share : run.injected) sum += share;
  EXPECT_LT((residual(run) - sum).cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_GT(test::rms(run.model_error), 0.01);
}

TEST(Effects, StrengthScalesWhatIsAdded) {
  const Robot robot = test::panda();
  for (const char* name :
       {"payload", "viscous_friction", "torque_offset", "joint_elasticity", "gravity_tilt"}) {
    const auto size = [&](double strength) {
      return test::rms(simulate(robot, {draw_effect(name, robot, 4, strength)}, motion()).injected[0]);
    };
    const double ratio = size(0.3) / size(1.0);
    EXPECT_NEAR(ratio, 0.3, 0.06) << name;
  }
}

TEST(Effects, DrawsAreSeededAndRunWithoutLosingTheRobot) {
  const Robot robot = test::panda();
  for (const EffectSchema& spec : effect_schemas()) {
    const Effect a = draw_effect(spec.name, robot, 7), b = draw_effect(spec.name, robot, 7);
    EXPECT_EQ(a.joints, b.joints);
    EXPECT_EQ(a.parameters, b.parameters);
    EXPECT_NE(a.parameters, draw_effect(spec.name, robot, 8).parameters) << spec.name;
  }
}

void expect_error(const std::string& text, const std::string& part) {
  try {
    parse_effect(text, test::panda());
    FAIL() << text << " was taken";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << text << ": " << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST(Effects, AreReadAndRefusedByName) {
  const Robot robot = test::panda();
  const Effect effect = parse_effect("coulomb_friction:joints=2+4,coefficient=0.8:0.5", robot);
  EXPECT_EQ(effect.joints, (std::vector<int>{2, 4}));
  EXPECT_EQ(effect.parameters.at("coefficient"), (std::vector<double>{0, 0.8, 0, 0.5, 0, 0, 0}));
  EXPECT_EQ(parse_effect("payload:mass=2,com=0.01:-0.02:0.1", robot).parameters.at("com"),
            (std::vector<double>{0.01, -0.02, 0.1}));
  EXPECT_EQ(parse_effect("external_contact:link=5", robot).joints.size(), 5u);

  expect_error("rust", "'rust': unknown");
  expect_error("payload:weight=2", "'weight'");
  expect_error("payload:mass=two", "mass: 'two' is not a number");
  expect_error("payload:mass=nan", "mass");
  expect_error("payload:mass=-1", "mass: -1 is not between");
  expect_error("payload:mass=1,mass=2", "mass: given twice");
  expect_error("payload:com=1:2", "com: expected 3 values, found 2");
  expect_error("payload:mass", "'mass' is not key=value");
  expect_error("payload:", "is not key=value");
  expect_error("coulomb_friction:joints=8", "no joint 8");
  expect_error("coulomb_friction:joints=2+2", "twice");
  expect_error("coulomb_friction:joints=4+2", "base to tip");
  expect_error("coulomb_friction:joints=1+2,coefficient=1:2:3", "expected one value or one for each");
  expect_error("gear_coupling:joints=6", "two joints");
  expect_error("link_inertial_error:joints=1+2", "one joint");
  expect_error("external_contact:link=8", "link: 8");
}

TEST(Effects, AnImpossibleBodyIsRefused) {
  const Robot robot = test::panda();
  EXPECT_THROW(simulate(robot, {parse_effect("link_inertial_error:joints=3,mass=-4", robot)}, motion()),
               Error);
}

}  // namespace
}  // namespace dynid
