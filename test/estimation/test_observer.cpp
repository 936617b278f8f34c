// SPDX-License-Identifier: Apache-2.0
// Laws of the parts: momentum, observer, wrench, contact flag.
#include <gtest/gtest.h>

#include "dynamics/chains.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

template <int N>
void expect_momentum(const Robot& robot, unsigned seed, int count) {
  const Model<N> model(robot);
  Workspace<N> ws(model);
  const int n = model.size();
  Generator generator(seed);
  for (int k = 0; k < count; ++k) {
    const Eigen::Matrix<double, N, 1> q = random_state(generator, n, 3.0),
                                      dq = random_state(generator, n, 3.0);
    Eigen::Matrix<double, N, 1> p(n), rate(n), g(n);
    Eigen::Matrix<double, N, N> M(n, n), S(n, n);
    momentum(model, ws, q, dq, p, rate);
    mass_matrix(model, ws, q, M);
    coriolis_matrix(model, ws, q, dq, S);
    gravity(model, ws, q, g);
    const VectorXd p_by_matrix = M * dq, rate_by_matrix = S.transpose() * dq - g;
    EXPECT_LT((p - p_by_matrix).norm(), 1e-12 * (1.0 + p.norm())) << robot.name << " seed " << seed;
    EXPECT_LT((rate - rate_by_matrix).norm(), 1e-11 * (1.0 + rate.norm() + (S.transpose() * dq).norm()))
        << robot.name << " seed " << seed;
  }
}

TEST(Momentum, IsThatOfTheMatrices) {
  expect_momentum<7>(panda(), 1, 200);
  expect_momentum<6>(ur_like(), 2, 200);
  for (unsigned seed = 0; seed < chains; ++seed) expect_momentum<Eigen::Dynamic>(random_chain(seed), seed, 5);
}

/// A motion in closed form, with the torques of the robot along it less `external`.
struct Motion {
  TorqueModel<7> model{panda()};
  Workspace<7> ws{model.rigid_body()};
  Vector7 q, dq, ddq, tau_f, tau;
  void at(double t, const Vector7& external) {
    for (int i = 0; i < 7; ++i) {
      const double w = 0.8 + 0.15 * i;
      q[i] = 0.4 * std::sin(w * t + i) + (i == 3 ? -1.5 : i == 5 ? 1.8 : 0.0);
      dq[i] = 0.4 * w * std::cos(w * t + i);
      ddq[i] = -0.4 * w * w * std::sin(w * t + i);
    }
    model.friction(q, dq, tau_f);
    model.torque(ws, q, dq, ddq, tau_f, tau);
    tau -= external;
  }
};

/// Mean delay of the answer to a step, the integral of 1 - r / tau_ext, joint by joint, and the worst
/// difference from the first-order answer in units of the step.
void step_response(ObserverOrder order, double gain, double mean_dt, double jitter, unsigned seed,
                   Vector7& delay, double& worst) {
  Generator generator(seed);
  Motion motion;
  const Vector7 external = (Vector7() << 5, -4, 3, -2, 1, -0.5, 0.25).finished();
  MomentumObserver<7> observer(Vector7::Constant(gain), order);
  Vector7 p, u;
  const auto sample = [&](double t) {
    motion.at(t, external);
    motion.model.momentum(motion.ws, motion.q, motion.dq, motion.tau, motion.tau_f, p, u);
  };
  sample(0.0);
  observer.start(p, u);
  delay.setZero();
  worst = 0.0;
  Vector7 before = Vector7::Ones();
  for (double t = 0.0; t < 15.0 / gain;) {
    const double dt = mean_dt * (1.0 + uniform(generator, -jitter, jitter));
    t += dt;
    sample(t);
    const Vector7 left = Vector7::Ones() - observer.update(dt, p, u).cwiseQuotient(external);
    // Exact for a decaying exponential between the samples.
    for (int i = 0; i < 7; ++i) {
      const double ratio = left[i] / before[i];
      delay[i] +=
          order == ObserverOrder::first && ratio > 1e-3 && ratio < 0.999999 && std::abs(left[i]) > 1e-4
              ? (before[i] - left[i]) * dt / -std::log(ratio)
              : 0.5 * (before[i] + left[i]) * dt;
      if (order == ObserverOrder::first) worst = std::max(worst, std::abs(left[i] - std::exp(-gain * t)));
    }
    before = left;
  }
}

TEST(MomentumObserver, TimeConstantIsTheInverseOfTheGainWhateverDt) {
  for (const double gain : {10.0, 50.0, 200.0}) {
    for (const double dt : {2.5e-4, 1e-3, 4e-3}) {
      for (const double jitter : {0.0, 0.3, 0.9}) {
        Vector7 delay;
        double worst = 0.0;
        step_response(ObserverOrder::first, gain, dt, jitter, 7, delay, worst);
        const std::string what = "K " + std::to_string(gain) + " dt " + std::to_string(dt) + " jitter " +
                                 std::to_string(jitter) + " seed 7";
        EXPECT_LT(worst, 0.003) << what;  // at t = 1/K: 0.8 % of 1 - 1/e at the most
        for (int i = 0; i < 7; ++i) EXPECT_NEAR(delay[i] * gain, 1.0, 0.01) << what << " joint " << i + 1;
      }
    }
  }
}

TEST(MomentumObserver, SecondOrderHasTheSameMeanDelay) {
  for (const double dt : {2.5e-4, 1e-3}) {
    for (const double jitter : {0.0, 0.9}) {
      Vector7 delay;
      double worst = 0.0;
      step_response(ObserverOrder::second, 50.0, dt, jitter, 8, delay, worst);
      for (int i = 0; i < 7; ++i)
        EXPECT_NEAR(delay[i] * 50.0, 1.0, 0.01) << "dt " << dt << " joint " << i + 1;
    }
  }
}

// Settled, the Kalman form is the first order with K = sqrt(drift / noise); where the noise is four times as
// large its gain is half of that.
TEST(MomentumObserver, KalmanGainFollowsTheNoise) {
  using Vector1 = Eigen::Matrix<double, 1, 1>;
  for (const double dt : {2.5e-4, 1e-3}) {
    MomentumObserver<1> kalman(Vector1(40.0), ObserverOrder::kalman);
    const Vector1 zero(0.0), drift(40.0 * 40.0 * 0.01), noise(0.01);
    const auto settle = [&](const Vector1& push, const Vector1& density, double seconds) {
      for (double t = 0.0; t < seconds; t += dt) kalman.update(dt, zero, push, drift, density);
      return kalman.residual()[0];
    };
    kalman.start(zero, zero);
    for (const double factor : {1.0, 4.0}) {
      const double before = settle(zero, factor * noise, 2.0);
      EXPECT_NEAR(before, 0.0, 1e-9);
      // A step of -u = 1 is followed as by K: the mean of the two ends of u makes the first step half of one.
      const double gain = 40.0 / std::sqrt(factor), after = settle(Vector1(-1.0), factor * noise, 1.0 / gain);
      EXPECT_NEAR(after, 1.0 - std::exp(-1.0), 0.02) << factor << " dt " << dt;
      // What it says of its own variance: that of a first order behind that noise, and of the drift.
      EXPECT_NEAR(kalman.variance()[0], std::sqrt(drift[0] * factor * noise[0]), 0.03 * kalman.variance()[0]);
    }
  }
}

// The estimates of a random walk behind white noise stray from it by what the filter says.
TEST(MomentumObserver, KalmanVarianceIsThatOfItsError) {
  using Vector1 = Eigen::Matrix<double, 1, 1>;
  Generator generator(12);
  const double dt = 1e-3, drift = 4.0, noise = 0.02;
  MomentumObserver<1> kalman(Vector1(1.0), ObserverOrder::kalman);
  const Vector1 zero(0.0);
  kalman.start(zero, zero);
  std::normal_distribution<double> unit;
  const auto normal = [&] { return unit(generator); };
  double external = 0.0, momentum = 0.0, square = 0.0, said = 0.0;
  for (int k = 0; k < 200000; ++k) {
    external += std::sqrt(drift * dt) * normal();
    momentum += (external + std::sqrt(noise / dt) * normal()) * dt;
    kalman.update(dt, Vector1(momentum), zero, Vector1(drift), Vector1(noise));
    square += std::pow(kalman.residual()[0] - external, 2), said += kalman.variance()[0];
  }
  EXPECT_NEAR(square / said, 1.0, 0.1);
}

TEST(MomentumObserver, StepsComposeExactly) {
  // Two steps of half the length are one step: of a free motion (u = dp/dt = 0) with r under way.
  using Vector1 = Eigen::Matrix<double, 1, 1>;
  for (const ObserverOrder order : {ObserverOrder::first, ObserverOrder::second}) {
    for (const double damping : {0.3, 0.7, 0.999999, 1.0}) {
      MomentumObserver<1> whole(Vector1(40.0), order, damping), halves(Vector1(40.0), order, damping);
      const Vector1 zero(0.0), push(-3.0);
      for (auto* observer : {&whole, &halves}) {
        observer->start(zero, push);
        observer->update(0.004, zero, push);
        observer->rebase(zero, zero);
      }
      for (int k = 0; k < 20; ++k) {
        whole.update(0.01, zero, zero);
        halves.update(0.004, zero, zero);
        halves.update(0.006, zero, zero);
        EXPECT_NEAR(whole.residual()[0], halves.residual()[0], 1e-13) << "damping " << damping;
      }
    }
  }
}

TEST(MomentumObserver, StaysWithinThePushForAnyStep) {
  using Vector1 = Eigen::Matrix<double, 1, 1>;
  for (const ObserverOrder order : {ObserverOrder::first, ObserverOrder::second}) {
    for (const double dt : {1e-9, 1e-3, 1.0, 1e3}) {
      MomentumObserver<1> observer(Vector1(100.0), order);
      observer.start(Vector1(0.0), Vector1(-2.0));  // held at rest against a push of 2
      for (int k = 0; k < 100; ++k) {
        const double r = observer.update(dt, Vector1(0.0), Vector1(-2.0))[0];
        EXPECT_GE(r, 0.0);
        EXPECT_LE(r, 2.0 + 1e-12);
      }
    }
  }
}

TEST(MomentumObserver, RefusesWhatIsNoGain) {
  EXPECT_THROW(MomentumObserver<7>{Vector7::Zero()}, Error);
  EXPECT_THROW(MomentumObserver<7>(Vector7::Constant(-1.0)), Error);
  EXPECT_THROW(MomentumObserver<7>(Vector7::Constant(std::nan(""))), Error);
  EXPECT_THROW(MomentumObserver<7>(Vector7::Ones(), ObserverOrder::second, 0.0), Error);
  EXPECT_THROW(MomentumObserver<7>(Vector7::Ones(), ObserverOrder::second, 1.1), Error);
}

TEST(ExternalWrench, ComesBackFromItsTorques) {
  for (const Robot& robot : {panda(), ur_like()}) {
    const Model<> model(robot);
    Workspace<> ws(model);
    Generator generator(3);
    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
    frame.linear() = random_rotation(generator);
    frame.translation() = random_vector(generator, 0.2);
    ExternalWrenchOptions in_frame;
    in_frame.axes = WrenchAxes::frame;
    ExternalWrench<> by_base(model, frame), by_frame(model, frame, in_frame);
    int regular = 0;
    for (int k = 0; k < 300; ++k) {
      const VectorXd q = random_state(generator, model.size(), 2.5);
      Vector6 F;
      F << random_vector(generator, 30.0), random_vector(generator, 5.0);
      MatrixXd J(6, model.size());
      jacobian(model, ws, q, frame, J);
      const VectorXd tau = J.transpose() * F;
      const Vector6 got = by_base.update(model, ws, q, tau), turned = by_frame.update(model, ws, q, tau);
      std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(model.size()) + 1);
      forward_kinematics(model, ws, q, poses);
      const Eigen::Matrix3d R = poses[static_cast<std::size_t>(model.size()) - 1].linear() * frame.linear();
      EXPECT_LT((R * turned.head<3>() - got.head<3>()).norm(), 1e-9 * (1 + got.norm()));
      EXPECT_LT((R * turned.tail<3>() - got.tail<3>()).norm(), 1e-9 * (1 + got.norm()));
      if (by_base.near_singular()) continue;
      ++regular;
      EXPECT_LT((got - F).norm(), 1e-7 * F.norm()) << robot.name << " state " << k << " of seed 3";
    }
    EXPECT_GT(regular, 150);
  }
}

TEST(ExternalWrench, MarginBoundsTheSmallestSingularValue) {
  const Model<7> model(panda());
  Workspace<7> ws(model);
  ExternalWrench<7> wrench(model, model.tip());
  Generator generator(4);
  for (int k = 0; k < 200; ++k) {
    Vector7 q = random_state(generator, 7, 2.5);
    if (k % 2 == 1) q[3] = q[5] = 1e-3 * uniform(generator, -1, 1);  // stretched
    Eigen::Matrix<double, 6, 7> J;
    jacobian(model, ws, q, J);
    J.bottomRows<3>() *= 0.25;
    const double least = Eigen::JacobiSVD<MatrixXd>(J).singularValues()[5];
    wrench.update(model, ws, q, Vector7::Zero());
    EXPECT_LE(wrench.margin(), least * (1 + 1e-6) + 1e-5) << "state " << k;
    EXPECT_GE(wrench.margin(), least / std::sqrt(6.0) * (1 - 1e-6)) << "state " << k;
    EXPECT_EQ(wrench.near_singular(), !(wrench.margin() >= 0.04));
  }
}

TEST(ExternalWrench, IsBoundedAndContinuousThroughASingularity) {
  const Model<7> model(panda());
  Workspace<7> ws(model);
  ExternalWrench<7> wrench(model, model.tip());
  const Vector7 tau = (Vector7() << 3, -5, 2, 4, -1, 0.5, 0.3).finished();
  Vector6 before = Vector6::Zero();
  bool flagged = false;
  for (int k = 0; k <= 20000; ++k) {  // the elbow goes through the stretched arm, the wrist through its own
    Vector7 q;
    const double x = 1.0 - 1e-4 * k;
    q << 0.2, 0.3 * x, 0.1 * x, x, -0.2 * x, x, 0.5;
    Vector6 F = wrench.update(model, ws, q, tau);
    flagged = flagged || wrench.near_singular();
    F.tail<3>() /= 0.25;
    ASSERT_TRUE(F.allFinite()) << k;
    // Nowhere longer than d / eps^2 or 1 / d allow.
    EXPECT_LT(F.norm(), tau.norm() / 0.04 * 1.01) << k;
    if (k > 0) {
      EXPECT_LT((F - before).norm(), 2.5) << k;
    }
    before = F;
  }
  EXPECT_TRUE(flagged);
}

TEST(ExternalWrench, FewJointsAreAlwaysNearASingularity) {
  Robot robot = panda();
  robot.joints.resize(4);
  const Model<4> model(robot);
  Workspace<4> ws(model);
  ExternalWrench<4> wrench(model, model.tip());
  const Eigen::Vector4d q(0.1, 0.4, -0.3, -1.2), tau(1, 2, 3, 4);
  const Vector6 F = wrench.update(model, ws, q, tau);
  EXPECT_TRUE(wrench.near_singular());
  EXPECT_TRUE(F.allFinite());
  EXPECT_LT(F.norm(), tau.norm() / 0.08 * 1.01);
}

TEST(ContactDetector, HasHysteresis) {
  using Vector1 = Eigen::Matrix<double, 1, 1>;
  ContactDetector<1> contact(Vector1(2.0), Vector1(1.0));
  const double r[] = {0.0, 1.5, 2.0, 2.1, 1.5, -1.5, 1.01, 1.0, 1.5, -2.5, 0.5};
  const bool flag[] = {false, false, false, true, true, true, true, false, false, true, false};
  for (int k = 0; k < 11; ++k) EXPECT_EQ(contact.update(Vector1(r[k]))[0], flag[k]) << k;
  EXPECT_THROW(ContactDetector<1>(Vector1(0.0), Vector1(0.0)), Error);
  EXPECT_THROW(ContactDetector<1>(Vector1(1.0), Vector1(2.0)), Error);
}

}  // namespace
}  // namespace dynid::test
