// SPDX-License-Identifier: Apache-2.0
// What TorqueEstimator promises cycle by cycle.
#include <gtest/gtest.h>

#include <limits>

#include "dynamics/chains.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid::test {
namespace {

using Eigen::VectorXd;
using Vector7 = Eigen::Matrix<double, 7, 1>;
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

LinkInertia two_kilograms() {
  LinkInertia payload;
  payload.mass = 2.0;
  payload.com = Eigen::Vector3d(0.02, -0.01, 0.08);
  payload.inertia = 0.003 * Eigen::Matrix3d::Identity();
  return payload;
}

/// A Panda, with a payload or not, in a motion in closed form under external torques.
struct Source {
  explicit Source(const LinkInertia& payload = {}) : model(panda()), ws(model.rigid_body()) {
    model.set_payload(payload);
  }
  TorqueModel<7> model;
  Workspace<7> ws;
  Vector7 q, dq, ddq, tau_f, tau;
  void at(double t, const Vector7& external = Vector7::Zero(), double size = 0.3) {
    for (int i = 0; i < 7; ++i) {
      const double w = 1.0 + 0.1 * i;
      q[i] = size * std::sin(w * t + i) + (i == 3 ? -1.5 : i == 5 ? 1.8 : 0.0);
      dq[i] = size * w * std::cos(w * t + i);
      ddq[i] = -size * w * w * std::sin(w * t + i);
    }
    model.friction(q, dq, tau_f);
    model.torque(ws, q, dq, ddq, tau_f, tau);
    tau -= external;
  }
};

const Vector7 push = (Vector7() << 5, -4, 3, -2, 1, -0.5, 0.25).finished();

TEST(TorqueEstimator, BothExternalTorquesArePositiveWhereTheRobotIsPushed) {
  Source source;
  TorqueEstimator<7> estimator(panda());
  for (int k = 0; k < 1000; ++k) {
    source.at(1e-3 * k, push);
    estimator.step(1e-3, source.q, source.dq, source.tau, source.ddq);
  }
  const Estimate<7>& e = estimator.estimate();
  EXPECT_EQ(e.status, Status::ok);
  EXPECT_LT((e.tau_external - push).norm(), 1e-10);
  EXPECT_LT((e.residual - push).norm(), 1e-3);
  EXPECT_LT((e.tau_model - source.tau - push).norm(), 1e-10);
  EXPECT_LT((e.tau_friction - source.tau_f).norm(), 1e-12);
  EXPECT_TRUE(e.contact[0] && e.contact[1] && e.contact[2] && !e.contact[3] && !e.contact[6]);
}

TEST(TorqueEstimator, EstimatesTheAcceleration) {
  Source source;
  TorqueEstimator<7> estimator(panda());
  for (int k = 0; k < 1000; ++k) {
    source.at(1e-3 * k);
    estimator.step(1e-3, source.q, source.dq, source.tau);
  }
  // Late by 1 / (2 pi 30 Hz) and half a step, that is 6 ms of a jerk of at most 1.3.
  EXPECT_LT((estimator.estimate().ddq - source.ddq).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_GT((estimator.estimate().ddq - source.ddq).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(TorqueEstimator, AnyRobotOfAnySizeFindsThePushOnIt) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Robot robot = random_chain(seed);
    const TorqueModel<> model(robot);
    Workspace<> ws(model.rigid_body());
    TorqueEstimatorOptions options;
    options.gain = VectorXd::Constant(1, 300.0);
    TorqueEstimator<> estimator(model, options);
    Generator generator(seed);
    const int n = robot.size();
    const VectorXd middle = random_state(generator, n, 1.0), external = random_state(generator, n, 5.0);
    VectorXd q(n), dq(n), ddq(n), tau(n), tau_f(n);
    for (int k = 0; k < 200; ++k) {
      const double t = 1e-3 * k;
      for (int i = 0; i < n; ++i) {
        q[i] = middle[i] + 0.2 * std::sin(t + i);
        dq[i] = 0.2 * std::cos(t + i), ddq[i] = -0.2 * std::sin(t + i);
      }
      model.friction(q, dq, tau_f);
      model.torque(ws, q, dq, ddq, tau_f, tau);
      estimator.step(1e-3, q, dq, tau - external, ddq);
    }
    EXPECT_LT((estimator.estimate().residual - external).norm(), 1e-3 * external.norm()) << "seed " << seed;
    EXPECT_LT((estimator.estimate().tau_external - external).norm(), 1e-9 * (1 + tau.norm()))
        << "seed " << seed;
  }
}

TEST(TorqueEstimator, SaysWhatIsWrongAndHoldsOrRestarts) {
  Source source;
  TorqueEstimator<7> estimator(panda());
  const auto run = [&](double dt, double t) -> const Estimate<7>& {
    source.at(t, push);
    return estimator.step(dt, source.q, source.dq, source.tau);
  };
  EXPECT_EQ(run(0.0, 0.0).status, Status::restarted);
  double t = 0.0;
  for (int k = 0; k < 300; ++k) EXPECT_EQ(run(1e-3, t += 1e-3).status, Status::ok);
  const Vector7 before = estimator.estimate().residual;
  EXPECT_GT(before[0], 4.9);

  // Each bad value in each place: outputs are held and the sample is as if it had been lost.
  for (const double bad : {nan_value, infinite, -infinite, 1e7}) {
    for (int place = 0; place < 21; ++place) {
      source.at(t, push);
      (place < 7 ? source.q : place < 14 ? source.dq : source.tau)[place % 7] = bad;
      const Estimate<7>& e = estimator.step(1e-4, source.q, source.dq, source.tau);
      EXPECT_EQ(e.status, Status::bad_input) << bad << " at " << place;
      EXPECT_EQ(e.residual, before);
    }
  }
  // 84 lost samples of 0.1 ms: the interval is that of the good ones.
  EXPECT_EQ(run(1e-4, t += 8.5e-3).status, Status::ok);
  EXPECT_LT((estimator.estimate().residual - push).norm(), 0.1);

  // No time has passed, or nothing has changed.
  EXPECT_EQ(run(0.0, t + 1.0).status, Status::stale);
  EXPECT_LT((estimator.estimate().residual - push).norm(), 0.1);
  EXPECT_EQ(run(1e-3, t).status, Status::stale);
  EXPECT_EQ(run(1e-3, t += 2e-3).status, Status::ok);

  EXPECT_EQ(run(-0.5, t -= 0.5).status, Status::time_went_back | Status::restarted);
  EXPECT_EQ(estimator.estimate().residual, Vector7(Vector7::Zero()));
  EXPECT_FALSE(estimator.estimate().contact.any());
  EXPECT_EQ(run(1e-3, t += 1e-3).status, Status::ok);
  EXPECT_EQ(run(0.2, t += 0.2).status, Status::gap | Status::restarted);
  EXPECT_EQ(run(nan_value, t).status, Status::bad_input);
  EXPECT_EQ(run(1e-3, t += 1e-3).status, Status::restarted);

  // A limit: of velocity, here.
  source.at(t += 1e-3, push);
  source.dq[2] = 2.2;
  EXPECT_EQ(estimator.step(1e-3, source.q, source.dq, source.tau).status, Status::limits_exceeded);

  // A wrong number of joints.
  EXPECT_TRUE(has(estimator.step(1e-3, VectorXd::Zero(6), source.dq, source.tau).status, Status::bad_input));
}

TEST(TorqueEstimator, StretchedArmIsNearSingular) {
  TorqueEstimator<7> estimator(panda());
  const Vector7 zero = Vector7::Zero();
  EXPECT_TRUE(has(estimator.step(1e-3, zero, zero, zero).status, Status::near_singular));
  EXPECT_TRUE(estimator.estimate().wrench.allFinite());
}

TEST(TorqueEstimator, PayloadIsTakenUpWithoutAJump) {
  Source source(two_kilograms());
  TorqueEstimator<7> estimator(panda());
  double t = 0.0;
  const auto run = [&]() -> const Estimate<7>& {
    source.at(t += 1e-3, Vector7::Zero(), 1.0);
    return estimator.step(1e-3, source.q, source.dq, source.tau);
  };
  for (int k = 0; k < 500; ++k) run();
  const Vector7 before = estimator.estimate().residual;
  EXPECT_GT(before.norm(), 3.0);  // the payload looks like a push
  TorqueModel<7> loaded(panda());
  loaded.set_payload(two_kilograms());
  estimator.adopt(loaded);
  EXPECT_TRUE(has(run().status, Status::model_changed));
  // One step of the filter towards zero and no more: 1 - exp(-60 * 1 ms) = 0.058.
  EXPECT_LT((estimator.estimate().residual - std::exp(-0.06) * before).norm(), 1e-3);
  for (int k = 0; k < 300; ++k) EXPECT_EQ(has(run().status, Status::model_changed), false);
  EXPECT_LT(estimator.estimate().residual.norm(), 1e-3);
  // And off again.
  loaded.set_payload({});
  estimator.adopt(loaded);
  for (int k = 0; k < 500; ++k) run();
  Source bare;
  bare.at(t, Vector7::Zero(), 1.0);
  EXPECT_LT((estimator.estimate().residual - (bare.tau - source.tau)).norm(), 0.5);  // 1/K late
  EXPECT_GT(estimator.estimate().residual.norm(), 3.0);
}

TEST(TorqueModel, PayloadIsABodyAtTheTip) {
  const Robot robot = panda();
  Robot loaded = robot;
  loaded.joints.back().parameters += transformed(to_standard(two_kilograms()), robot.tip);
  TorqueModel<7> by_call(robot);
  by_call.set_payload(two_kilograms());
  Robot with_effect = robot;
  Effect effect;
  effect.name = "payload";
  effect.parameters = {{"mass", {2.0}}, {"com", {0.02, -0.01, 0.08}}, {"radius", {std::sqrt(0.003 / 0.8)}}};
  with_effect.effects = {effect};
  const TorqueModel<7> by_effect(with_effect), expected(loaded);
  Workspace<7> ws(expected.rigid_body());
  Generator generator(11);
  for (int k = 0; k < 20; ++k) {
    const Vector7 q = random_state(generator, 7, 2.0), dq = random_state(generator, 7, 2.0),
                  ddq = random_state(generator, 7, 2.0);
    Vector7 a, b, c;
    expected.torque(ws, q, dq, ddq, Vector7::Zero(), a);
    by_call.torque(ws, q, dq, ddq, Vector7::Zero(), b);
    by_effect.torque(ws, q, dq, ddq, Vector7::Zero(), c);
    EXPECT_LT((a - b).norm() + (a - c).norm(), 1e-10);
  }
}

TEST(TorqueModel, CompensatesStaticEffectsAndNamesTheOthers) {
  Robot robot = panda();
  const std::vector<int> all = {1, 2, 3, 4, 5, 6, 7};
  const std::vector<double> k(7, 3.0), rest(7, 0.4), b(7, 1.5), f(7, 0.6), v(7, 0.2), half(7, 0.3);
  robot.effects = {
      {"joint_spring", all, {{"stiffness", k}, {"rest", rest}}},
      {"torque_offset", all, {{"offset", b}}},
      {"viscous_friction", all, {{"coefficient", f}}},
      {"asymmetric_coulomb_friction",
       all,
       {{"coefficient_positive", f}, {"coefficient_negative", half}, {"velocity_scale", {0.01}}}},
      {"stribeck_friction", all, {{"static", f}, {"stribeck_velocity", v}, {"velocity_scale", {0.02}}}},
      {"time_delay", {1}, {{"delay", {0.002}}}},
      {"backlash", {1}, {}},
      {"time_delay", {2}, {}}};
  const TorqueModel<7> with(robot, Uncompensated::ignore), without(panda());
  Generator generator(12);
  for (int i = 0; i < 50; ++i) {
    const Vector7 q = random_state(generator, 7, 2.0), dq = random_state(generator, 7, 0.5);
    Vector7 a, c;
    with.friction(q, dq, a);
    without.friction(q, dq, c);
    for (int j = 0; j < 7; ++j) {
      const double x = dq[j] / 0.2, expected = 3.0 * (q[j] - 0.4) + 1.5 + 0.6 * dq[j] +
                                               (dq[j] > 0 ? 0.6 : 0.3) * std::tanh(dq[j] / 0.01) +
                                               0.6 * std::exp(-x * x) * std::tanh(dq[j] / 0.02);
      EXPECT_NEAR(a[j] - c[j], expected, 1e-12);
    }
  }
  EXPECT_EQ(uncompensated_effects(robot), (std::vector<std::string>{"time_delay", "backlash"}));
  EXPECT_THROW(TorqueModel<7>{robot}, Error);
  robot.effects = {{"joint_spring", {1}, {{"rest", {1.0}}}}};
  EXPECT_THROW(TorqueModel<7>{robot}, Error);
  robot.effects = {{"joint_spring", {1}, {{"stiffness", {1.0, 2.0}}}}};
  EXPECT_THROW(TorqueModel<7>{robot}, Error);
}

TEST(TorqueModel, FrictionIsThatOfTheFrictionLaws) {
  Robot robot = panda();
  Generator generator(13);
  for (Joint& joint : robot.joints)
    joint.friction.linear = {uniform(generator, 0, 2), uniform(generator, 0, 2), uniform(generator, -1, 1),
                             uniform(generator, 0, 0.1)};
  const TorqueModel<7> model(robot);
  for (int k = 0; k < 50; ++k) {
    const Vector7 dq = random_state(generator, 7, 2.0);
    Vector7 f;
    model.friction(Vector7::Zero(), dq, f);
    for (int j = 0; j < 7; ++j)
      EXPECT_NEAR(f[j], friction_torque(robot.joints[static_cast<std::size_t>(j)].friction, dq[j]), 1e-13);
  }
}

TEST(TorqueEstimator, NeverAWrongNumberFromRandomInput) {
  const int count = states(200000);
  Source source;
  TorqueEstimator<7> estimator(panda());
  Generator generator(14);
  const double odd[] = {nan_value, infinite, -infinite, 1e300, -1e300, 1e-310, 0.0, 1e6, 50.0};
  long good = 0;
  double t = 0.0;
  for (int k = 0; k < count; ++k) {
    source.at(t += 1e-3, push);
    double dt = 1e-3;
    bool spoilt = false;
    for (int hits = uniform(generator, 0, 1) < 0.1 ? 3 : 0; hits > 0; --hits) {
      const int place = static_cast<int>(uniform(generator, 0, 22));
      const double value = odd[static_cast<int>(uniform(generator, 0, 9))];
      spoilt = true;
      if (place < 7)
        source.q[place] = value;
      else if (place < 14)
        source.dq[place - 7] = value;
      else if (place < 21)
        source.tau[place - 14] = value;
      else
        dt = value;
    }
    const Estimate<7>& e = estimator.step(dt, source.q, source.dq, source.tau);
    ASSERT_TRUE(e.residual.allFinite() && e.tau_model.allFinite() && e.wrench.allFinite() &&
                e.tau_external.allFinite())
        << "seed 14, sample " << k;
    if (!spoilt && e.status == Status::ok) ++good;
  }
  EXPECT_GT(good, count / 3);
}

TEST(TorqueEstimator, RefusesOptionsOutOfRange) {
  const Robot robot = panda();
  const auto refused = [&](auto change) {
    TorqueEstimatorOptions options;
    change(options);
    EXPECT_THROW(TorqueEstimator<7>(robot, options), Error);
  };
  refused([](auto& o) { o.gain = VectorXd::Constant(3, 1.0); });
  refused([](auto& o) { o.gain = VectorXd::Constant(7, -1.0); });
  refused([](auto& o) { o.contact_threshold = VectorXd::Constant(1, nan_value); });
  refused([](auto& o) { o.contact_release = 1.5; });
  refused([](auto& o) { o.acceleration_cutoff = 0.0; });
  refused([](auto& o) { o.longest_dt = infinite; });
  refused([](auto& o) { o.wrench.length = 0.0; });
  refused([](auto& o) { o.wrench.singular_below = -1.0; });
  EXPECT_THROW(TorqueEstimator<6>{robot}, Error);
  TorqueEstimator<> estimator(robot);
  EXPECT_THROW(estimator.adopt(TorqueModel<>(ur_like())), Error);
  LinkInertia payload = two_kilograms();
  payload.com.x() = nan_value;
  TorqueModel<> model(robot);
  model.set_payload(payload);
  EXPECT_THROW(estimator.adopt(model), Error);
}

}  // namespace
}  // namespace dynid::test
