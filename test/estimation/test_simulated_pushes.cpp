// SPDX-License-Identifier: Apache-2.0
// The estimator on the simulated Panda: pushes found, nothing found where there is none.
#include <gtest/gtest.h>

#include <cstdlib>

#include "dynamics/chains.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/estimation/torque_estimator.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid::test {
namespace {

using Eigen::VectorXd;

SimulatedRun run(const Robot& robot, const std::vector<Effect>& effects, double duration, bool realistic,
                 unsigned long seed) {
  SimulateOptions options;
  options.seed = seed;
  options.record_torques = !effects.empty();
  if (realistic) options.measurement = MeasurementOptions::realistic();
  return simulate(robot, effects, random_motion(robot, duration, seed), options);
}

template <class F>
void replay(const SimulatedRun& run, TorqueEstimator<7>& estimator, const F& each) {
  const Log& log = run.log;
  for (Eigen::Index k = 0; k < log.samples(); ++k) {
    const double dt = k > 0 ? log.t[k] - log.t[k - 1] : 0.0;
    each(k,
         estimator.step(dt, log.q.row(k).transpose(), log.dq.row(k).transpose(), log.tau.row(k).transpose()));
  }
}

/// Error of the residual over random pushes, relative to them, rms over joints and time of contact.
double recovery(bool realistic, const TorqueEstimatorOptions& options) {
  const Robot robot = panda();
  double error = 0.0, size = 0.0;
  for (unsigned long seed = 1; seed <= 12; ++seed) {
    const Effect push = draw_effect("external_contact", robot, seed, 1.0, 10.0);
    const double start = push.parameters.at("start")[0];
    const double end = start + push.parameters.at("duration")[0];
    const SimulatedRun simulated = run(robot, {push}, 10.0, realistic, seed);
    TorqueEstimator<7> estimator(robot, options);
    double its_error = 0.0, its_size = 0.0;
    replay(simulated, estimator, [&](Eigen::Index k, const Estimate<7>& e) {
      const double t = simulated.t[k];
      if (t < start || t > end + 0.1) return;
      const VectorXd truth = -simulated.injected[0].row(k).transpose();  // the catalogue's sign: -J^T F
      its_error += (e.residual - truth).squaredNorm(), its_size += truth.squaredNorm();
    });
    EXPECT_GT(its_size, 0.0) << "seed " << seed;
    if (!realistic) {
      EXPECT_LT(std::sqrt(its_error / its_size), 0.05) << "seed " << seed;
    }
    error += its_error, size += its_size;
  }
  return std::sqrt(error / size);
}

TEST(SimulatedPushes, AreRecovered) {
  TorqueEstimatorOptions options;
  options.gain = VectorXd::Constant(1, 300.0);
  const double clean = recovery(false, options);
  options.order = ObserverOrder::second;
  options.damping = 0.7;
  const double noisy = recovery(true, options);
  RecordProperty("clean_percent", std::to_string(100 * clean));
  RecordProperty("realistic_percent", std::to_string(100 * noisy));
  std::printf("pushes recovered within %.2f %% rms; with realistic electronics %.2f %%\n", 100 * clean,
              100 * noisy);
  EXPECT_LT(clean, 0.05);
  EXPECT_LT(noisy, 0.05);
}

// 10 minutes, or DYNID_TEST_MINUTES, by the default options.
TEST(SimulatedPushes, NoContactWithoutOne) {
  const Robot robot = panda();
  const char* text = std::getenv("DYNID_TEST_MINUTES");
  const int minutes = text != nullptr ? std::max(1, std::atoi(text)) : 10;
  double largest = 0.0;
  for (int minute = 1; minute <= minutes; ++minute) {
    const SimulatedRun simulated = run(robot, {}, 60.0, true, static_cast<unsigned long>(100 + minute));
    TorqueEstimator<7> estimator(robot);
    long flagged = 0;
    replay(simulated, estimator, [&](Eigen::Index, const Estimate<7>& e) {
      if (e.contact.any()) ++flagged;
      largest = std::max(largest, e.residual.cwiseAbs().maxCoeff());
    });
    EXPECT_EQ(flagged, 0) << "seed " << 100 + minute;
  }
  std::printf("largest residual without a contact: %.2f N m\n", largest);
  EXPECT_GT(largest, 0.01);  // there was noise
}

// A force that makes 5 N m on the joint that feels it most, by the default options.
TEST(SimulatedPushes, FiveNewtonMetresAreDetectedWithin20Milliseconds) {
  const Robot robot = panda();
  const Model<7> model(robot);
  Workspace<7> ws(model);
  double slowest = 0.0;
  for (unsigned long seed = 1; seed <= 20; ++seed) {
    Generator generator(seed);
    const double start = uniform(generator, 1.0, 2.5);
    // Where the arm is then: from a run without the push.
    const SimulatedRun free = run(robot, {}, 4.0, true, seed);
    Eigen::Index at = 0;
    while (free.t[at] < start) ++at;
    Eigen::Matrix<double, 6, 7> J;
    jacobian(model, ws, free.q.row(at).transpose(), Eigen::Isometry3d::Identity(), J);
    const Eigen::Vector3d direction = random_vector(generator, 1.0);
    const VectorXd torque = J.topRows<3>().transpose() * direction;
    const Eigen::Vector3d force = direction * (5.0 / torque.cwiseAbs().maxCoeff());
    Effect push;
    push.name = "external_contact";
    push.parameters = {{"link", {7.0}},
                       {"force", {force.x(), force.y(), force.z()}},
                       {"start", {start}},
                       {"duration", {0.5}},
                       {"rise_time", {0.001}}};
    const SimulatedRun simulated = run(robot, {push}, 4.0, true, seed);
    TorqueEstimator<7> estimator(robot);
    double first = 1e9;
    replay(simulated, estimator, [&](Eigen::Index k, const Estimate<7>& e) {
      if (e.contact.any() && first > 1e8) first = simulated.t[k] - start;
    });
    EXPECT_GT(first, 0.0) << "seed " << seed;
    EXPECT_LT(first, 0.020) << "seed " << seed;
    slowest = std::max(slowest, first);
  }
  std::printf("slowest detection of 5 N m: %.1f ms\n", 1e3 * slowest);
}

}  // namespace
}  // namespace dynid::test
