// SPDX-License-Identifier: Apache-2.0
// dynid init: a first model of a Denavit-Hartenberg table.
#include "dynid/app/init.hpp"

#include <gtest/gtest.h>

#include <random>
#include <regex>

#include "dynid/app/option_error.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

InitJob job_of(const std::vector<std::string>& names, const Eigen::MatrixXd& values) {
  InitJob job;
  job.dh.source = "table.csv";
  job.dh.names = names;
  job.dh.values = values;
  return job;
}

/// Pose of the tip in the base frame.
Eigen::Isometry3d tip_of(const Robot& robot, const Eigen::VectorXd& q) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    pose = pose * joint.origin;
    if (joint.type == JointType::prismatic)
      pose = pose * Eigen::Translation3d(q[j] * joint.axis);
    else
      pose = pose * Eigen::AngleAxisd(q[j], joint.axis);
  }
  return pose * robot.tip;
}

Eigen::Isometry3d about_x(double angle, double length) {
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX())) *
         Eigen::Translation3d(length, 0, 0);
}
Eigen::Isometry3d about_z(double angle, double length) {
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())) *
         Eigen::Translation3d(0, 0, length);
}

/// Law: the arm stands where the product of the rows says, by either convention.
TEST(Init, StandsWhereTheRowsSay) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> any(-1.5, 1.5);
    const int n = 1 + static_cast<int>(seed % 7);
    Eigen::MatrixXd rows(n, 4);  // theta, d, alpha, a: in any order
    for (double& x : rows.reshaped()) x = any(random);
    InitJob job = job_of({"theta", "d", "alpha", "a"}, rows);
    job.convention = seed % 2 == 0 ? DhConvention::standard : DhConvention::modified;
    job.degrees = seed % 3 == 0;
    for (int j = 0; j < n; ++j) job.types += "RPC"[random() % 3];
    const InitReport report = run(job);

    Eigen::VectorXd q(n);
    Eigen::Isometry3d expected = Eigen::Isometry3d::Identity();
    for (int j = 0; j < n; ++j) {
      q[j] = any(random);
      const double unit = job.degrees ? M_PI / 180.0 : 1.0;
      const bool slides = job.types[static_cast<std::size_t>(j)] == 'P';
      const Eigen::Isometry3d z =
          about_z(unit * rows(j, 0) + (slides ? 0.0 : q[j]), rows(j, 1) + (slides ? q[j] : 0.0));
      const Eigen::Isometry3d x = about_x(unit * rows(j, 2), rows(j, 3));
      expected = job.convention == DhConvention::standard ? expected * z * x : expected * x * z;
    }
    EXPECT_LT((tip_of(report.robot, q).matrix() - expected.matrix()).cwiseAbs().maxCoeff(), 1e-12)
        << "seed " << seed << "\n"
        << report.text;
  }
}

/// Law: with the mark of the examples taken away, all of them are a model of bodies that can exist.
TEST(Init, ExamplesBehindTheMarkAreAModel) {
  for (const std::string types : {"RPC", "PPP", "CRR"}) {
    InitJob job = job_of({"a", "alpha", "d"}, Eigen::MatrixXd::Constant(3, 3, 0.3));
    job.types = types;
    job.joint_names = {"pan", "lift.2", "wrist-3"};
    job.gravity = Eigen::Vector3d(9.81, 0, 0);
    const std::string text = std::regex_replace(run(job).text, std::regex("\n    #: "), "\n    ");
    EXPECT_EQ(text.find("\n    #:"), std::string::npos);
    const Robot robot = parse_model(text, "filled in").robot;
    EXPECT_NO_THROW(validate(robot)) << text;
    EXPECT_TRUE(inconsistencies(robot).empty()) << text;
    EXPECT_EQ(robot.gravity, job.gravity);
    for (const Joint& joint : robot.joints) {
      EXPECT_GT(joint.parameters[0], 0.0);
      EXPECT_GT(joint.rotor_inertia, 0.0);
      EXPECT_GT(joint.friction.torque(0.1), 0.0);
      EXPECT_TRUE(std::isfinite(joint.limits.torque));
      EXPECT_EQ(std::isfinite(joint.limits.upper), joint.type != JointType::continuous);
      ASSERT_TRUE(joint.servo.has_value());
    }
    EXPECT_EQ(robot.joints[1].name, "lift.2");
  }
}

/// The robot that is told of knows no more than the table.
TEST(Init, ClaimsNothingThatTheTableDoesNotSay) {
  const InitReport report = run(job_of({"a", "alpha", "d"}, Eigen::MatrixXd::Constant(2, 3, 0.1)));
  EXPECT_TRUE(report.robot.parameters().isZero(0.0));
  for (const Joint& joint : report.robot.joints) {
    EXPECT_FALSE(joint.servo.has_value());
    EXPECT_FALSE(std::isfinite(joint.limits.velocity));
    EXPECT_EQ(joint.friction.torque(1.0), 0.0);
  }
}

void expect_refused(const InitJob& job, const std::string& part) {
  try {
    run(job);
    ADD_FAILURE() << "not refused: " << part;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(Init, RefusesByName) {
  const Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, 3);
  expect_refused(job_of({"a", "alpha", "theta"}, rows), "table.csv: no column 'd'");
  expect_refused(job_of({"a", "alpha", "r"}, rows), "table.csv: column 'r' is none of");
  InitJob job = job_of({"a", "alpha", "d"}, rows);
  job.types = "RR";
  expect_refused(job, "types: 'RR'");
  job.types = "RRX";
  expect_refused(job, "types: 'RRX'");
  job.types.clear();
  job.joint_names = {"a", "b"};
  expect_refused(job, "names: 2 for the table's 3 joints");
  job.joint_names = {"a", "b", "a"};
  expect_refused(job, "two joints are called 'a'");
  job.joint_names = {"a", "b: [", "c"};
  expect_refused(job, "names: 'b: ['");
  job.joint_names.clear();
  job.name = "";
  expect_refused(job, "name: ''");
  job.name = "arm";
  job.gravity[1] = std::nan("");
  expect_refused(job, "gravity: ");
}

}  // namespace
}  // namespace dynid
