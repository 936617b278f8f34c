// SPDX-License-Identifier: Apache-2.0
// Gains, thresholds and filters changed while the loop runs.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "dynamics/chains.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid::test {
namespace {

// An arm at rest, pushed on its first joint by `push`.
template <int N>
struct Rest {
  explicit Rest(TorqueEstimator<N>& e) : estimator(e), q(7), dq(7), ddq(7), tau(7) {
    q << 0.1, -0.5, 0.2, -1.8, 0.3, 1.9, 0.4;
    dq.setZero(), ddq.setZero(), tau.setZero();
    tau = estimator.step(0.0, q, dq, tau, ddq).tau_model;
    estimator.reset();
  }
  const Estimate<N>& step(double push) {
    q[6] += 1e-10;  // a sample of its own
    Eigen::Matrix<double, N, 1> measured = tau;
    measured[0] -= push;
    return estimator.step(1e-3, q, dq, measured, ddq);
  }
  TorqueEstimator<N>& estimator;
  Eigen::Matrix<double, N, 1> q, dq, ddq, tau;
};

template <int N>
void retunes() {
  TorqueEstimator<N> estimator(panda());
  Rest<N> rest(estimator);
  for (int k = 0; k < 500; ++k) rest.step(2.0);
  EXPECT_NEAR(estimator.estimate().residual[0], 2.0, 1e-3);
  EXPECT_FALSE(estimator.estimate().contact.any()) << "2.8 N m are needed";

  TorqueEstimatorOptions options;
  options.gain = Eigen::VectorXd::Constant(1, 10.0);
  options.contact_threshold = Eigen::VectorXd::Constant(1, 1.5);
  estimator.retune(options);
  const Status status = rest.step(2.0).status;
  EXPECT_EQ(status, Status::ok);
  EXPECT_NEAR(estimator.estimate().residual[0], 2.0, 1e-3) << "no jump";
  EXPECT_TRUE(estimator.estimate().contact[0]);
  for (int k = 0; k < 100; ++k) rest.step(12.0);  // a time constant of 0.1 s
  EXPECT_NEAR(estimator.estimate().residual[0], 2.0 + 10.0 * -std::expm1(-1.0), 0.1);

  const auto refused = [&](const char* what, TorqueEstimatorOptions wrong) {
    try {
      estimator.retune(wrong);
      ADD_FAILURE() << what;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  options.gain[0] = 0.0;
  refused("gain", options);
  options.gain = Eigen::VectorXd::Constant(3, 1.0);
  refused("gain", options);
  options = {};
  options.contact_release = 2.0;
  refused("contact threshold", options);
  options = {};
  options.acceleration_cutoff = 0.0;
  refused("acceleration_cutoff", options);
  // What was refused changed nothing.
  const double before = estimator.estimate().residual[0];
  rest.step(12.0);
  EXPECT_NEAR(estimator.estimate().residual[0] - before, (12.0 - before) * -std::expm1(-0.01), 1e-3);
}

TEST(Retune, GainThresholdAndFilterWhileRunning) { retunes<7>(); }
TEST(Retune, GainThresholdAndFilterWhileRunningDynamic) { retunes<Eigen::Dynamic>(); }

// For the thread sanitizer too.
TEST(Retune, FromAnotherThread) {
  const TorqueModel<> model(panda());
  TorqueEstimator<> estimator(model);
  Rest<Eigen::Dynamic> rest(estimator);
  std::atomic<bool> done{false};
  std::thread other([&] {
    TorqueEstimatorOptions options;
    for (int k = 0; k < 2000; ++k) {
      options.gain = Eigen::VectorXd::Constant(1, k % 2 == 0 ? 30.0 : 90.0);
      estimator.retune(options);
      estimator.adopt(model);
      std::this_thread::yield();
    }
    done = true;
  });
  for (long k = 0; !done || k < 1000; ++k) ASSERT_NEAR(rest.step(0.0).residual.norm(), 0.0, 1e-3) << k;
  other.join();
}

}  // namespace
}  // namespace dynid::test
