// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {
namespace {

double position(double t, int j) { return std::sin((0.8 + 0.3 * j) * t) + 0.3 * std::cos(2.1 * t + j); }
double velocity(double t, int j) {
  return (0.8 + 0.3 * j) * std::cos((0.8 + 0.3 * j) * t) - 0.63 * std::sin(2.1 * t + j);
}
double acceleration(double t, int j) {
  const double w = 0.8 + 0.3 * j;
  return -w * w * std::sin(w * t) - 0.3 * 2.1 * 2.1 * std::cos(2.1 * t + j);
}

/// A clean log of three joints whose dq comes `lag` late, at the stamps given.
Log make_log(const std::vector<double>& stamps, double lag = 0.0, double noise = 0.0) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  Log log;
  log.source = "synthetic";
  const auto n = static_cast<Eigen::Index>(stamps.size());
  log.t = Eigen::Map<const Eigen::VectorXd>(stamps.data(), n);
  for (Eigen::MatrixXd* m : {&log.q, &log.dq, &log.tau}) m->resize(n, 3);
  for (Eigen::Index i = 0; i < n; ++i)
    for (int j = 0; j < 3; ++j) {
      log.q(i, j) = position(log.t[i], j) + noise * 1e-2 * normal(random);
      log.dq(i, j) = velocity(log.t[i] - lag, j) + noise * normal(random);
      log.tau(i, j) = 5.0 * position(log.t[i], j) + noise * normal(random);
    }
  return log;
}

std::vector<double> uniform(double rate, double duration) {
  std::vector<double> stamps;
  for (int i = 0; double(i) / rate <= duration; ++i) stamps.push_back(double(i) / rate);
  return stamps;
}

const DataIssue* find(const PreparedLog& log, const std::string& name) {
  const auto& issues = log.report.issues;
  const auto it =
      std::find_if(issues.begin(), issues.end(), [&](const DataIssue& i) { return i.name == name; });
  return it == issues.end() ? nullptr : &*it;
}

TEST(Prepare, CleanLogHasNoIssuesAndTheRightAccelerations) {
  for (double rate : {100.0, 500.0, 1000.0}) {
    PrepareOptions options;
    options.cutoff = 6.0;
    const PreparedLog p = prepare(make_log(uniform(rate, 12.0)), options);
    EXPECT_TRUE(p.report.issues.empty()) << p.report.issues.front().name;
    EXPECT_NEAR(p.report.rate_hz, rate, 1e-6 * rate);
    ASSERT_EQ(p.segments.size(), 1u);
    const Segment& s = p.segments[0];
    for (Eigen::Index i = s.t.size() / 6; i < s.t.size() * 5 / 6; ++i)
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(s.q(i, j), position(s.t[i], j), 1e-3);
        EXPECT_NEAR(s.dq(i, j), velocity(s.t[i], j), 2e-3);
        EXPECT_NEAR(s.ddq(i, j), acceleration(s.t[i], j), 1e-2);
      }
  }
}

TEST(Prepare, VelocityLagIsFoundToATenthOfAMillisecondAndMended) {
  for (double lag : {-0.012, 0.0025, 0.005, 0.03}) {
    PrepareOptions options;
    options.cutoff = 6.0;
    const PreparedLog p = prepare(make_log(uniform(500.0, 12.0), lag, 1e-3), options);
    const DataIssue* issue = find(p, "velocity_lag");
    ASSERT_NE(issue, nullptr) << lag;
    EXPECT_NEAR(issue->value, lag, 1e-4);
    EXPECT_TRUE((p.velocity_lag.array() == issue->value).all());
    const Segment& s = p.segments[0];
    const Eigen::Index i = s.t.size() / 2;
    EXPECT_NEAR(s.dq(i, 1), velocity(s.t[i], 1), 5e-3);
  }
  EXPECT_EQ(find(prepare(make_log(uniform(500.0, 12.0), 0.0, 1e-3)), "velocity_lag"), nullptr);
}

// Law: what one joint's dq is late by, or is scaled by, is said of that joint, and neither is taken for the
// other.
TEST(Prepare, LagAndGainOfTheVelocityAreThoseOfTheirJoint) {
  PrepareOptions options;
  options.cutoff = 6.0;
  Log log = make_log(uniform(500.0, 12.0), 0.003, 1e-3);
  for (Eigen::Index i = 0; i < log.samples(); ++i) log.dq(i, 2) = velocity(log.t[i] - 0.013, 2);
  const PreparedLog late = prepare(log, options);
  ASSERT_EQ(late.velocity_lag.size(), 3);
  EXPECT_NEAR(late.velocity_lag[0], 0.003, 2e-4);
  EXPECT_NEAR(late.velocity_lag[1], 0.003, 2e-4);
  EXPECT_NEAR(late.velocity_lag[2], 0.013, 2e-4);
  EXPECT_EQ(find(late, "velocity_gain"), nullptr);

  log = make_log(uniform(500.0, 12.0), 0.0, 1e-3);
  log.dq.col(1) *= 1.1;
  const PreparedLog scaled = prepare(log, options);
  EXPECT_EQ(find(scaled, "velocity_lag"), nullptr);
  const DataIssue* gain = find(scaled, "velocity_gain");
  ASSERT_NE(gain, nullptr);
  EXPECT_EQ(gain->joints, std::vector<int>{2});
  EXPECT_NEAR(gain->value, 1.1, 0.005);
}

TEST(Prepare, RepeatsJitterAndGapsAreNamedWithTheirSize) {
  std::mt19937_64 random(23);
  std::vector<double> stamps;
  double now = 0.0;
  for (int i = 0; i < 4000; ++i) stamps.push_back(now += 0.002 + 0.0004 * double(random() % 1000) / 1000.0);
  Log log = make_log(stamps);
  for (Eigen::Index i = 10; i < 4000; i += 20) {  // 5 % repeats of the row before, under a stamp of their own
    log.q.row(i) = log.q.row(i - 1);
    log.dq.row(i) = log.dq.row(i - 1);
    log.tau.row(i) = log.tau.row(i - 1);
  }
  log.t.tail(2000).array() += 1.5;
  PrepareOptions options;
  options.cutoff = 8.0;
  const PreparedLog p = prepare(log, options);
  ASSERT_NE(find(p, "repeated_rows"), nullptr);
  EXPECT_NEAR(find(p, "repeated_rows")->value, 0.05, 1e-3);
  ASSERT_NE(find(p, "jitter"), nullptr);
  ASSERT_NE(find(p, "gaps"), nullptr);
  EXPECT_NEAR(find(p, "gaps")->value, 1.5, 0.01);
  EXPECT_EQ(p.segments.size(), 2u);
  options.bridge_gaps = true;
  EXPECT_EQ(prepare(log, options).segments.size(), 1u);
}

TEST(Prepare, SaturationQuantisationAndDeadChannelsAreNamedByJoint) {
  Log log = make_log(uniform(500.0, 10.0));
  log.tau.col(0) = log.tau.col(0).cwiseMax(-3.0).cwiseMin(3.0);
  log.tau.col(2).setConstant(0.5);
  log.q.col(1) = (log.q.col(1) * 1000.0).array().round() / 1000.0;
  const PreparedLog p = prepare(log);
  ASSERT_NE(find(p, "saturation"), nullptr);
  EXPECT_EQ(find(p, "saturation")->joints, std::vector<int>{1});
  ASSERT_NE(find(p, "constant_channel"), nullptr);
  EXPECT_EQ(find(p, "constant_channel")->joints, std::vector<int>{3});
  ASSERT_NE(find(p, "quantisation"), nullptr);
  EXPECT_EQ(find(p, "quantisation")->joints, std::vector<int>{2});
  EXPECT_NEAR(find(p, "quantisation")->value, 1e-3, 1e-9);
}

TEST(Prepare, AccelerationComesFromTheQuieterChannel) {
  Log noisy_velocity = make_log(uniform(500.0, 12.0)), noisy_position = noisy_velocity;
  std::mt19937_64 random(29);
  std::normal_distribution<double> normal;
  for (double& x : noisy_velocity.dq.reshaped()) x += 0.1 * normal(random);
  for (double& x : noisy_position.q.reshaped()) x += 1e-2 * normal(random);
  EXPECT_EQ(prepare(noisy_velocity).motion, MotionSource::position);
  EXPECT_EQ(prepare(noisy_position).motion, MotionSource::velocity);
}

TEST(Prepare, CutOffFollowsTheMotionAndTheRate) {
  EXPECT_NEAR(choose_cutoff(make_log(uniform(500.0, 40.0))), 10.0 * 2.1 / (2.0 * M_PI), 1.0);
  std::vector<double> slow = uniform(10.0, 40.0);
  EXPECT_LE(choose_cutoff(make_log(slow)), 10.0 / 6.0 + 1e-9);
}

TEST(Prepare, RefusesWhatCannotBeUsed) {
  EXPECT_THROW(prepare(make_log(uniform(500.0, 0.02))), Error);  // 11 samples
  Log still = make_log(uniform(500.0, 4.0));
  for (Eigen::MatrixXd* m : {&still.q, &still.dq, &still.tau}) m->rowwise() = Eigen::RowVectorXd(m->row(0));
  EXPECT_THROW(prepare(still), Error);  // every row repeats the first
  PrepareOptions options;
  options.cutoff = 300.0;
  EXPECT_THROW(prepare(make_log(uniform(500.0, 4.0)), options), Error);
}

}  // namespace
}  // namespace dynid
