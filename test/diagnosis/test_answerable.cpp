// SPDX-License-Identifier: Apache-2.0
// Whether a log can answer: what could not be seen on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dynid/diagnosis/answerable.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

/// All joints swing about the middle of their range, each at a frequency of its own.
Log swinging(const Robot& robot, double part_of_range = 0.3) {
  const int n = robot.size(), rows = 2000;
  Log log;
  log.source = "swinging";
  log.t = Eigen::VectorXd::LinSpaced(rows, 0.0, 20.0);
  log.q.resize(rows, n), log.dq.resize(rows, n);
  Eigen::MatrixXd ddq(rows, n);
  for (int j = 0; j < n; ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const double a = 0.5 * part_of_range * (limits.upper - limits.lower), w = 1.0 + 0.1 * j;
    log.q.col(j) = (a * (w * log.t).array().sin() + 0.5 * (limits.upper + limits.lower)).matrix();
    log.dq.col(j) = (a * w * (w * log.t).array().cos()).matrix();
    ddq.col(j) = (-a * w * w * (w * log.t).array().sin()).matrix();
  }
  log.tau = predict_torque(robot, log.q, log.dq, ddq).tau;
  return log;
}

Answerable of(const Robot& robot, const Log& log) {
  PrepareOptions options;
  options.cutoff = 8.0;
  return can_answer(robot, {log}, {prepare(log, options)});
}

const Blindness* find(const Answerable& a, const std::string& name) {
  const auto it = std::find_if(a.blind.begin(), a.blind.end(), [&](const auto& b) { return b.name == name; });
  return it == a.blind.end() ? nullptr : &*it;
}

TEST(Answerable, AMotionThatShowsAllLeavesLengthBandAndChannels) {
  const Robot robot = panda();
  const Answerable a = of(robot, swinging(robot));
  EXPECT_NEAR(a.duration, 20.0, 0.1);
  EXPECT_NEAR(a.rate_hz, 100.0, 0.1);
  EXPECT_EQ(a.channels, (std::vector<std::string>{"q", "dq", "tau"}));
  ASSERT_EQ(a.joints.size(), 7u);
  for (const char* name : {"joint_at_rest", "no_reversal", "one_speed"})
    EXPECT_EQ(find(a, name), nullptr) << name;
  for (const char* name : {"length", "band", "channel"}) EXPECT_NE(find(a, name), nullptr) << name;
  for (const JointExcitation& e : a.joints) EXPECT_GT(e.reversals, 4);
}

TEST(Answerable, AJointThatRestsIsNamed) {
  const Robot robot = panda();
  Log log = swinging(robot);
  log.q.col(2).setConstant(0.1);
  log.dq.col(2).setZero();
  const Answerable a = of(robot, log);
  const Blindness* rest = find(a, "joint_at_rest");
  ASSERT_NE(rest, nullptr);
  EXPECT_EQ(rest->joints, std::vector<int>{3});
  EXPECT_NE(rest->text.find("joint 3 hardly moves"), std::string::npos) << rest->text;
}

TEST(Answerable, AJointThatDoesNotTurnBackIsNamed) {
  const Robot robot = panda();
  Log log = swinging(robot);
  log.q.col(4) = (0.05 * log.t.array() - 0.5 + 0.01 * log.t.array().sin()).matrix();
  log.dq.col(4) = (0.05 + 0.01 * log.t.array().cos()).matrix();
  const Answerable a = of(robot, log);
  ASSERT_NE(find(a, "no_reversal"), nullptr);
  EXPECT_EQ(find(a, "no_reversal")->joints, std::vector<int>{5});
  EXPECT_EQ(find(a, "slow")->joints, std::vector<int>{5});
}

TEST(Answerable, ALoadThatDoesNotVaryIsNamed) {
  Robot robot = panda();
  const Log log = swinging(robot, 0.03);  // gravity hardly changes, and little inertia
  const Answerable a = of(robot, log);
  const Blindness* steady = find(a, "steady_load");
  ASSERT_NE(steady, nullptr);
  EXPECT_NE(std::find(steady->joints.begin(), steady->joints.end(), 4), steady->joints.end()) << steady->text;
}

TEST(Answerable, ChannelsThatAreThereAreNotMissed) {
  const Robot robot = panda();
  Log log = swinging(robot);
  log.theta = log.q, log.tau_cmd = log.tau, log.temp = log.q;
  EXPECT_EQ(find(of(robot, log), "channel"), nullptr);
}

}  // namespace
}  // namespace dynid
