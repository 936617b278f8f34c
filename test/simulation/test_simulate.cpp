// SPDX-License-Identifier: Apache-2.0
// Closed-loop runs: what the electronics do, the spread of parameters, and what can be identified from a run.
#include "dynid/simulation/simulate.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

#include "dynid/identification/identify.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(RandomMotion, KeepsItsLimitsAndRestsAtItsEnds) {
  const Robot robot = test::panda();
  for (unsigned long seed = 0; seed < 50; ++seed) {
    const Trajectory motion = random_motion(robot, 5.0 + double(seed % 20), seed);
    const Eigen::Index last = motion.samples() - 1;
    EXPECT_LT(motion.dq.row(0).cwiseAbs().maxCoeff(), 1e-9) << "seed " << seed;
    EXPECT_LT(motion.ddq.row(0).cwiseAbs().maxCoeff(), 1e-9) << "seed " << seed;
    EXPECT_LT(motion.dq.row(last).cwiseAbs().maxCoeff(), 1e-6) << "seed " << seed;
    EXPECT_LT(motion.ddq.row(last).cwiseAbs().maxCoeff(), 1e-6) << "seed " << seed;
    for (int j = 0; j < 7; ++j) {
      const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
      EXPECT_GT(motion.q.col(j).minCoeff(), limits.lower) << "seed " << seed;
      EXPECT_LT(motion.q.col(j).maxCoeff(), limits.upper) << "seed " << seed;
      EXPECT_LT(motion.dq.col(j).cwiseAbs().maxCoeff(), limits.velocity) << "seed " << seed;
      EXPECT_LT(motion.ddq.col(j).cwiseAbs().maxCoeff(), limits.acceleration) << "seed " << seed;
      EXPECT_GT(motion.q.col(j).maxCoeff() - motion.q.col(j).minCoeff(), 0.1) << "seed " << seed;
    }
    // dq and ddq are the derivatives of q: by central differences.
    const double h = 1e-3;
    const MatrixXd slope = (motion.q.bottomRows(last - 1) - motion.q.topRows(last - 1)) / (2 * h);
    EXPECT_LT((slope - motion.dq.middleRows(1, last - 1)).cwiseAbs().maxCoeff(), 1e-4) << "seed " << seed;
    const MatrixXd bend = (motion.dq.bottomRows(last - 1) - motion.dq.topRows(last - 1)) / (2 * h);
    EXPECT_LT((bend - motion.ddq.middleRows(1, last - 1)).cwiseAbs().maxCoeff(), 1e-3) << "seed " << seed;
  }
}

TEST(Perturbed, BodiesStayPossibleAndDifferByTheSpread) {
  const Robot robot = test::panda();
  const double spread = 0.05;
  double mass = 0.0, friction = 0.0;
  constexpr int count = 200;
  for (unsigned long seed = 0; seed < count; ++seed) {
    const Robot other = perturbed(robot, spread, seed);
    EXPECT_EQ(inconsistencies(other, 0.0).size(), inconsistencies(robot, 0.0).size()) << "seed " << seed;
    for (int j = 0; j < 7; ++j) {
      const auto k = static_cast<std::size_t>(j);
      mass += std::pow(other.joints[k].parameters[0] / robot.joints[k].parameters[0] - 1.0, 2);
      friction +=
          std::pow(other.joints[k].friction.sigmoid.phi1 / robot.joints[k].friction.sigmoid.phi1 - 1.0, 2);
    }
  }
  EXPECT_NEAR(std::sqrt(friction / (7.0 * count)), spread, 0.1 * spread);
  const double mass_spread = std::sqrt(mass / (7.0 * count));
  EXPECT_GT(mass_spread, 0.5 * spread);
  EXPECT_LT(mass_spread, 2.0 * spread);
  EXPECT_EQ(perturbed(robot, 0.0, 3).parameters(), robot.parameters());
  EXPECT_EQ(perturbed(robot, spread, 3).parameters(), perturbed(robot, spread, 3).parameters());
  EXPECT_THROW(perturbed(robot, 0.7, 3), Error);
}

TEST(Simulate, ANoiseFreeLogIsPredicted) {
  const Robot robot = test::panda();
  const Trajectory motion = random_motion(robot, 20.0, 2);
  for (const double rate : {1000.0, 250.0}) {
    SimulateOptions options;
    options.rate = rate;
    options.record_acceleration = true;
    SimulatedRun run = simulate(robot, {}, motion, options);
    EXPECT_EQ(run.log.samples(), static_cast<Eigen::Index>(20.0 * rate) + 1);
    EXPECT_LT((predict_torque(robot, run.log).tau - run.log.tau).cwiseAbs().maxCoeff(), 1e-9);
    // Without the acceleration it is differentiated: away from the ends of the filter the same.
    run.log.ddq.resize(0, 0);
    const MatrixXd left = predict_torque(robot, run.log, rate / 10.0).tau - run.log.tau;
    const auto edge = static_cast<Eigen::Index>(0.25 * rate);
    const double worst = left.middleRows(edge, left.rows() - 2 * edge).cwiseAbs().maxCoeff();
    std::printf("  %.0f Hz, acceleration differentiated: %.1e N m\n", rate, worst);
    EXPECT_LT(worst, 1e-3);
  }
}

TEST(Simulate, FollowsItsMotion) {
  const Robot robot = test::panda();
  const Trajectory motion = random_motion(robot, 10.0, 4);
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  const SimulatedRun run = simulate(robot, {}, motion, options);
  EXPECT_LT((run.q - motion.q.topRows(run.q.rows())).cwiseAbs().maxCoeff(), 5e-3);
}

TEST(Simulate, TheElectronicsDoWhatTheySay) {
  const Robot robot = test::panda();
  const Trajectory motion = random_motion(robot, 20.0, 6);
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic(2.0);
  const SimulatedRun run = simulate(robot, {}, motion, options);
  const Log& log = run.log;
  const MeasurementOptions& m = options.measurement;
  std::vector<Eigen::Index> fresh;
  for (Eigen::Index i = 1; i < log.samples(); ++i)
    if (log.tau.row(i) != log.tau.row(i - 1)) fresh.push_back(i);
  const double lost = 1.0 - double(fresh.size()) / double(log.samples() - 1);
  EXPECT_NEAR(lost, m.repeat_probability, 0.3 * m.repeat_probability);
  // Quantised, and never further off than half a quantum.
  for (const Eigen::Index i : fresh) {
    const Eigen::ArrayXd counts = log.q.row(i).transpose().array() / m.encoder_resolution;
    ASSERT_LT((counts - counts.round()).abs().maxCoeff(), 1e-6);
    ASSERT_LE((log.q.row(i) - run.q.row(i)).cwiseAbs().maxCoeff(), 0.5001 * m.encoder_resolution);
  }
  // Late by the filter's time constant, the difference's half step and the filter's own sampling.
  double best = HUGE_VAL, late = 0.0;
  for (int step = 0; step <= 40; ++step) {
    const double lag = 1e-4 * step;
    double error = 0.0;
    for (Eigen::Index i = 100; i < run.t.size(); i += 7)
      error += (log.dq.row(i) - (run.dq.row(i) - lag * run.ddq.row(i))).squaredNorm();
    if (error < best) best = error, late = lag;
  }
  const double passed = -std::expm1(-2.0 * M_PI * m.velocity_cutoff * 1e-3);
  EXPECT_NEAR(late, 0.5e-3 + 1e-3 * (1.0 - passed) / passed, 1.5e-4);
  for (int j = 0; j < 7; ++j) {
    const double scale = std::sqrt(robot.joints[static_cast<std::size_t>(j)].limits.torque * 87.0);  // [N m]
    EXPECT_NEAR(torque_ranges(robot)[j], scale, 1e-9);
    double white = 0.0, all = 0.0;  // the slow part hardly moves from one row to the next
    for (const Eigen::Index i : fresh) {
      const double now = log.tau(i, j) - run.tau(i, j),
                   next = i + 1 < log.samples() ? log.tau(i + 1, j) - run.tau(i + 1, j) : now;
      all += now * now;
      white += 0.5 * (next - now) * (next - now);
    }
    const double count = double(fresh.size());
    EXPECT_NEAR(std::sqrt(white / count), m.white_noise * scale, 0.05 * m.white_noise * scale);
    EXPECT_NEAR(std::sqrt(all / count), std::hypot(m.white_noise, m.correlated_noise) * scale,
                0.1 * m.white_noise * scale);
  }
  double mean = 0.0;
  for (Eigen::Index i = 0; i < log.t.size(); ++i) {
    mean += (log.t[i] - run.t[i]) / double(log.t.size());
    ASSERT_TRUE(i == 0 || log.t[i] > log.t[i - 1]);
  }
  EXPECT_NEAR(mean, m.stamp_jitter, 0.1 * m.stamp_jitter);
}

TEST(Simulate, IsTheSameForASeedOnly) {
  const Robot robot = test::panda();
  const Trajectory motion = random_motion(robot, 2.0, 1);
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.spread = 0.01;
  const SimulatedRun a = simulate(robot, {}, motion, options), b = simulate(robot, {}, motion, options);
  EXPECT_EQ(a.log.tau, b.log.tau);
  EXPECT_EQ(a.log.t, b.log.t);
  options.seed = 2;
  EXPECT_NE(simulate(robot, {}, motion, options).log.tau, a.log.tau);
}

TEST(Simulate, APatchedModelHasItsEffects) {
  Robot robot = test::panda();
  robot.effects = {parse_effect("torque_offset:joints=3,offset=2", robot)};
  const SimulatedRun run = simulate(robot, {parse_effect("payload", robot)}, random_motion(robot, 2.0, 1));
  ASSERT_EQ(run.truth.effects.size(), 2u);
  EXPECT_EQ(run.truth.effects[0].name, "torque_offset");
  EXPECT_NEAR(run.injected[0].col(2).mean(), 2.0, 1e-12);
}

TEST(Simulate, RefusesByName) {
  const Robot robot = test::panda();
  const Trajectory motion = random_motion(robot, 2.0, 1);
  SimulateOptions options;
  options.rate = 300.0;
  try {
    simulate(robot, {}, motion, options);
    FAIL() << "300 Hz do not divide 1000 Hz";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("250 Hz would"), std::string::npos) << error.what();
  }
  Robot six = robot;
  six.joints.pop_back();
  EXPECT_THROW(simulate(six, {}, motion), Error);
  SimulateOptions unstable;
  unstable.gains.damping = -1.0;
  unstable.measurement = MeasurementOptions::realistic();
  try {
    simulate(robot, {parse_effect("payload", robot)}, motion, unstable);
    FAIL() << "the robot should have run away";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("left its motion at"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("does not know of payload"), std::string::npos) << error.what();
  }
}

TEST(Simulate, OtherArms) {
  // Six joints, one of them prismatic, and two joints: what is compiled for any size.
  Robot six = test::panda();
  six.joints.pop_back();
  six.joints[2].type = JointType::prismatic;
  six.joints[2].limits.lower = -0.3, six.joints[2].limits.upper = 0.3;
  Robot two = six;
  two.joints.resize(2);
  for (const Robot& robot : {six, two}) {
    const Trajectory motion = random_motion(robot, 4.0, 1);
    std::vector<Effect> effects = {parse_effect("payload", robot), parse_effect("gear_coupling", robot),
                                   parse_effect("external_contact:start=1", robot)};
    const SimulatedRun run = simulate(robot, effects, motion);
    MatrixXd left = run.seen_tau - predict_torque(robot, run.seen_q, run.seen_dq, run.seen_ddq).tau;
    for (const MatrixXd& share : run.injected) left -= share;
    EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-9) << robot.size() << " joints";
  }
}

TEST(Log, IsReadBackAsItWasWritten) {
  const Robot robot = test::panda();
  SimulateOptions options;
  options.record_acceleration = options.record_command = true;
  options.measurement = MeasurementOptions::realistic();
  const Log log = simulate(robot, {}, random_motion(robot, 1.0, 1), options).log;
  const std::string path = ::testing::TempDir() + "dynid_simulated.csv";
  write_log(path, log);
  const Log back = read_log(path, 7);
  std::filesystem::remove(path);
  EXPECT_EQ(back.t, log.t);
  EXPECT_EQ(back.q, log.q);
  EXPECT_EQ(back.dq, log.dq);
  EXPECT_EQ(back.tau, log.tau);
  EXPECT_EQ(back.ddq, log.ddq);
  EXPECT_EQ(back.tau_cmd, log.tau_cmd);
  EXPECT_EQ(back.theta.size(), 0);
}

// Coefficients identified from a noisy run lie within three of their reported standard deviations of the
// truth, 95 times in 100 at least.
TEST(Simulate, IdentifiedCoefficientsAreAsGoodAsTheySay) {
  Robot robot = test::panda();
  for (int j = 0; j < 7; ++j)
    robot.joints[static_cast<std::size_t>(j)].friction = {
        {0.3 + 0.05 * j, 0.4 - 0.02 * j, 0.1 * (j - 3), 0.02}, {}};
  const Trajectory motion = random_motion(robot, 20.0, 11);
  IdentifyOptions identify_options;
  identify_options.validate = false;
  identify_options.prune_percent = 0.0;
  int inside = 0, all = 0;
  double square = 0.0;
  for (unsigned long seed = 1; seed <= 20; ++seed) {
    SimulateOptions options;
    options.measurement = MeasurementOptions::realistic();
    options.rate = 500.0;
    options.seed = seed;
    options.record_torques = false;
    const SimulatedRun run = simulate(robot, {}, motion, options);
    const Identification id = identify(robot, {run.log}, {}, identify_options);
    VectorXd truth(id.values.size());
    truth.head(id.base.size()) = id.base.K * parameter_vector(robot, id.base);
    for (int j = 0; j < 7; ++j) {
      const LinearFriction& f = robot.joints[static_cast<std::size_t>(j)].friction.linear;
      truth.segment<3>(id.base.size() + 3 * j) << f.viscous, f.coulomb, f.offset;
    }
    for (Eigen::Index k = 0; k < truth.size(); ++k) {
      const double z = (id.values[k] - truth[k]) / std::sqrt(id.variance[k]);
      inside += std::abs(z) <= 3.0;
      square += z * z;
      ++all;
    }
  }
  std::printf("  %d of %d within three standard deviations; rms of the error over its deviation %.2f\n",
              inside, all, std::sqrt(square / all));
  EXPECT_GE(inside, 0.95 * all);
}

}  // namespace
}  // namespace dynid
