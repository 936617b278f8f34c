// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class TrajectoryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_trajectory_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& text) const {
    const std::string path = (folder_ / "motion.csv").string();
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  /// what() of the refusal.
  static std::string refusal(const std::string& path, int joints) {
    try {
      read_trajectory(path, joints);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }

  fs::path folder_;
};

/// Polynomials of `degree` with random coefficients, joint by joint, at unevenly spaced instants.
Trajectory polynomials(unsigned seed, int joints, int samples, int degree) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Trajectory motion;
  motion.t.resize(samples);
  for (int i = 0; i < samples; ++i)
    motion.t[i] = (i > 0 ? motion.t[i - 1] : 2.0) + 0.1 + 0.05 * uniform(random);
  motion.q = motion.dq = motion.ddq = Eigen::MatrixXd::Zero(samples, joints);
  for (int j = 0; j < joints; ++j)
    for (int k = 0; k <= degree; ++k) {
      const double c = uniform(random);
      for (int i = 0; i < samples; ++i) {
        const double s = motion.t[i] - 2.5;
        motion.q(i, j) += c * std::pow(s, k);
        if (k > 0) motion.dq(i, j) += c * k * std::pow(s, k - 1);
        if (k > 1) motion.ddq(i, j) += c * k * (k - 1) * std::pow(s, k - 2);
      }
    }
  return motion;
}

TEST_F(TrajectoryTest, ReadsBackWhatItWrites) {
  const Trajectory motion = polynomials(1, 3, 20, 5);
  const std::string path = (folder_ / "written.csv").string();
  write_trajectory(path, motion);
  const Trajectory read = read_trajectory(path, 3);
  EXPECT_EQ(read.source, path);
  EXPECT_EQ(read.t, motion.t);
  EXPECT_EQ(read.q, motion.q);
  EXPECT_EQ(read.dq, motion.dq);
  EXPECT_EQ(read.ddq, motion.ddq);
  EXPECT_EQ(read_trajectory(path, 0).joints(), 3);
  Trajectory uneven = motion;
  uneven.dq.conservativeResize(19, 3);
  EXPECT_THROW(write_trajectory(path, uneven), Error);
  EXPECT_EQ(read_trajectory(path, 3).q, motion.q);
}

TEST_F(TrajectoryTest, DifferentiatesWhatIsAbsentExactlyForParabolas) {
  const Trajectory motion = polynomials(2, 1, 12, 2);
  std::string text = "t,q1\n";
  for (int i = 0; i < 12; ++i) {
    char row[80];
    std::snprintf(row, sizeof row, "%.17g,%.17g\n", motion.t[i], motion.q(i, 0));
    text += row;
  }
  const Trajectory read = read_trajectory(write(text), 1);
  EXPECT_LT((read.dq - motion.dq).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((read.ddq - motion.ddq).cwiseAbs().maxCoeff(), 1e-10);
}

TEST_F(TrajectoryTest, RefusesByLineAndColumn) {
  EXPECT_NE(refusal(write("t,q1\n0,1\n1,2\n1,3\n"), 1).find("motion.csv:4: column t"), std::string::npos);
  EXPECT_NE(refusal(write("t,q1\n0,1\n1,x\n2,3\n"), 1).find("motion.csv:3: column q1"), std::string::npos);
  EXPECT_NE(refusal(write("t,q1\n0,1\n1,2\n2,3\n"), 2).find("column q2 is missing"), std::string::npos);
  EXPECT_NE(refusal(write("t,q1,q2\n0,1,1\n1,2,1\n2,3,1\n"), 1).find("column q2"), std::string::npos);
  EXPECT_NE(refusal(write("q1\n0\n1\n2\n"), 1).find("column t is missing"), std::string::npos);
  EXPECT_NE(refusal(write("t,q1,q2,dq2\n0,0,0,0\n1,0,0,0\n2,0,0,0\n"), 2).find("column dq1 is missing"),
            std::string::npos);
  EXPECT_NE(refusal(write("t,q1\n0,1\n1,2\n"), 1).find("2 samples"), std::string::npos);
}

TEST_F(TrajectoryTest, SamplesQuinticsExactlyAndHoldsTheEnds) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Trajectory all = polynomials(seed, 2, 11, 5);
    Trajectory motion = all;  // every other sample: the others are what must come out
    motion.t.resize(6);
    motion.q.resize(6, 2);
    motion.dq.resize(6, 2);
    motion.ddq.resize(6, 2);
    for (int i = 0; i < 6; ++i) {
      motion.t[i] = all.t[2 * i];
      motion.q.row(i) = all.q.row(2 * i);
      motion.dq.row(i) = all.dq.row(2 * i);
      motion.ddq.row(i) = all.ddq.row(2 * i);
    }
    Eigen::VectorXd q, dq, ddq;
    for (int i = 0; i < 11; ++i) {
      sample(motion, all.t[i], q, dq, ddq);
      EXPECT_LT((q - all.q.row(i).transpose()).norm(), 1e-12) << "seed " << seed << ", sample " << i;
      EXPECT_LT((dq - all.dq.row(i).transpose()).norm(), 1e-11) << "seed " << seed << ", sample " << i;
      EXPECT_LT((ddq - all.ddq.row(i).transpose()).norm(), 1e-9) << "seed " << seed << ", sample " << i;
    }
    for (const auto& [time, row] : {std::pair{-1.0, 0}, std::pair{99.0, 5}}) {
      sample(motion, time, q, dq, ddq);
      EXPECT_EQ(q, motion.q.row(row).transpose());
      EXPECT_EQ(dq.norm() + ddq.norm(), 0.0);
    }
  }
}

TEST_F(TrajectoryTest, JointTrajectoryIsTheMessage) {
  Trajectory motion = polynomials(3, 2, 30, 4);
  motion.t[29] = motion.t[0] + 2.9999999999;  // rounds up to whole seconds
  motion.q(0, 0) = 1e-5;                      // 1e-05 would be text to a YAML 1.1 reader
  const std::string text = to_joint_trajectory(motion, {"one", "two"});
  EXPECT_EQ(text.find("e-"), std::string::npos);
  const YAML::Node message = YAML::Load(text);
  EXPECT_EQ(message["header"]["stamp"]["secs"].as<int>(), 0);
  EXPECT_EQ(message["joint_names"].as<std::vector<std::string>>(), (std::vector<std::string>{"one", "two"}));
  ASSERT_EQ(message["points"].size(), 30u);
  EXPECT_EQ(message["points"][29]["time_from_start"]["secs"].as<int>(), 3);
  EXPECT_EQ(message["points"][29]["time_from_start"]["nsecs"].as<int>(), 0);
  for (int i = 0; i < 29; ++i) {
    const YAML::Node point = message["points"][i];
    const YAML::Node stamp = point["time_from_start"];
    EXPECT_NEAR(stamp["secs"].as<int>() + 1e-9 * stamp["nsecs"].as<int>(), motion.t[i] - motion.t[0], 1e-9);
    for (int j = 0; j < 2; ++j) {
      EXPECT_NEAR(point["positions"][j].as<double>(), motion.q(i, j), 1e-9);
      EXPECT_NEAR(point["velocities"][j].as<double>(), motion.dq(i, j), 1e-9);
      EXPECT_NEAR(point["accelerations"][j].as<double>(), motion.ddq(i, j), 1e-9);
    }
  }
  EXPECT_THROW(to_joint_trajectory(motion, {"one"}), Error);
}

}  // namespace
}  // namespace dynid
