// SPDX-License-Identifier: Apache-2.0
// dynid bounds: what may be assumed of a robot's links, from its file.
#include "dynid/app/bounds.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <random>
#include <sstream>

#include "dynid/app/option_error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/retrieval/collision_box.hpp"
#include "dynid/retrieval/retrieval.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class BoundsOfAFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(::testing::TempDir()) / ("dynid_bounds_" + std::to_string(::getpid()) + "_" +
                                          ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// An arm of two links; `first` and `second` are what stands in them.
  BoundsJob job(const std::string& first, const std::string& second) const {
    const std::string path = (folder_ / "arm.urdf").string();
    write_file(path, R"(<robot name="arm"><link name="base"/><link name="upper">)" + first +
                         R"(</link><link name="lower">)" + second + R"(</link>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/><origin xyz="0 0 0.2"/>
<limit lower="-2" upper="2" velocity="2" effort="50"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/><origin xyz="0.4 0 0"/>
<limit lower="-2" upper="2" velocity="2" effort="50"/></joint></robot>)");
    BoundsJob job;
    job.robot = read_urdf(path);
    job.source = path;
    job.urdf = true;
    job.named = "arm.urdf";
    return job;
  }
  Bounds read_back(const BoundsReport& report) const {
    const std::string path = (folder_ / "bounds.yaml").string();
    write_file(path, report.text);
    return read_bounds(path);
  }

  fs::path folder_;
};

std::string inertial(double mass, const std::string& xyz, double inertia) {
  const std::string i = std::to_string(inertia);
  return "<inertial><origin xyz=\"" + xyz + "\"/><mass value=\"" + std::to_string(mass) +
         "\"/><inertia ixx=\"" + i + "\" iyy=\"" + i + "\" izz=\"" + i +
         "\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
}
const char* const box_geometry =
    R"(<collision><origin xyz="0.2 0 0"/><geometry><box size="0.5 0.12 0.1"/></geometry></collision>)";
const char* const cylinder_geometry =
    R"(<collision><origin xyz="0 0 0.1" rpy="0.4 0.7 0"/><geometry><cylinder radius="0.05" length="0.3"/></geometry></collision>)";

std::vector<LinkInertia> links_of(const Robot& robot) {
  std::vector<LinkInertia> links;
  for (const Joint& joint : robot.joints) links.push_back(from_standard(joint.parameters));
  return links;
}

/// Law: the robot of the file is within its own bounds, shapes among them, and what is written reads as what
/// is told.
TEST_F(BoundsOfAFile, HoldTheRobotThatTheyAreMadeOf) {
  const BoundsJob job = this->job(inertial(4, "0.2 0.01 0", 0.02) + box_geometry,
                                  inertial(2, "0.01 0 0.1", 0.004) + cylinder_geometry);
  const BoundsReport report = run(job);
  const Bounds bounds = read_back(report);
  EXPECT_EQ(bounds.lower, report.lower);
  EXPECT_EQ(bounds.upper, report.upper);
  EXPECT_EQ(bounds.total_mass_lower, report.total_mass[0]);
  EXPECT_EQ(bounds.constraints.size(), 2U) << report.text;
  EXPECT_EQ(report.with_mass, 2);
  EXPECT_EQ(report.with_geometry, 2);
  EXPECT_TRUE(report.notes.empty());
  for (const ConstraintMargin& c : constraint_margins(bounds, links_of(job.robot)))
    EXPECT_GE(c.margin, -1e-12) << c.name;
  // The box of the first link is that of the geometry, and its mass is known to a factor.
  EXPECT_NEAR(report.lower[1], -0.05, 1e-12);
  EXPECT_NEAR(report.upper[1], 0.45, 1e-12);
  EXPECT_NEAR(report.upper[2], 0.06, 1e-12);
  EXPECT_EQ(report.lower[0], 1.33333);
  EXPECT_NEAR(report.upper[0], 6.6, 1e-12);  // three times 4 kg are more than all
}

/// Every line of a bound has a comment that says where it comes from.
TEST_F(BoundsOfAFile, SayWhereEachLineComesFrom) {
  std::istringstream text(
      run(job(inertial(4, "0.2 0 0", 0.02) + box_geometry, inertial(2, "0 0 0.1", 0.004))).text);
  int lines = 0;
  for (std::string line; std::getline(text, line);) {
    if (line.find(": [") == std::string::npos) continue;
    ++lines;
    EXPECT_GT(line.size(), line.find("]  # ") + 10) << line;
  }
  EXPECT_EQ(lines, 13);
}

/// Law: no body of the largest mass within the box, however it is made, exceeds the bounds of its inertia.
TEST_F(BoundsOfAFile, NoBodyWithinTheGeometryExceedsThem) {
  const BoundsReport report = run(
      job(inertial(4, "0.2 0 0", 0.02) + box_geometry, inertial(2, "0 0 0.1", 0.004) + cylinder_geometry));
  for (unsigned seed = 1; seed <= 500; ++seed) {
    std::mt19937_64 random(seed);
    const Eigen::Index k = 10 * static_cast<Eigen::Index>(seed % 2);
    StandardParameters sum = StandardParameters::Zero();
    for (int point = 0; point < 4; ++point) {  // heavy points, often in the corners: the worst there is
      LinkInertia p;
      p.mass = report.upper[k] / 4.0;
      for (Eigen::Index i = 0; i < 3; ++i) {
        const double part =
            random() % 3 == 0 ? std::uniform_real_distribution<double>()(random) : double(random() % 2);
        p.com[i] = report.lower[k + 1 + i] + part * (report.upper[k + 1 + i] - report.lower[k + 1 + i]);
      }
      sum += to_standard(p);
    }
    const LinkInertia body = from_standard(sum);
    const double diagonal = report.upper[k + 4] * (1 + 1e-12), product = report.upper[k + 5] * (1 + 1e-12);
    EXPECT_LE(body.inertia.diagonal().maxCoeff(), diagonal) << "seed " << seed;
    for (const auto& [a, b] : {std::pair{0, 1}, {0, 2}, {1, 2}})
      EXPECT_LE(std::abs(body.inertia(a, b)), product) << "seed " << seed;
  }
}

TEST_F(BoundsOfAFile, BoxOfATurnedCylinderIsExact) {
  const BoundsJob job =
      this->job(inertial(4, "0 0 0.1", 0.02) + cylinder_geometry, inertial(2, "0 0 0", 0.004));
  const Eigen::AlignedBox3d box = collision_box(job.source, 1).value();
  const Eigen::Isometry3d pose = Eigen::Translation3d(0, 0, 0.1) *
                                 Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX());
  Eigen::AlignedBox3d seen;
  for (int k = 0; k < 100000; ++k) {
    const double angle = 2.0 * M_PI * k / 100000;
    for (const double z : {-0.15, 0.15})
      seen.extend(pose * Eigen::Vector3d(0.05 * std::cos(angle), 0.05 * std::sin(angle), z));
  }
  EXPECT_LT((box.min() - seen.min()).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((box.max() - seen.max()).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_FALSE(collision_box(job.source, 2).has_value());
}

/// A centre of mass beyond the geometry, and a mesh that is not there, are said; the bounds still hold the
/// robot.
TEST_F(BoundsOfAFile, SayWhatOfTheFileCannotBeUsed) {
  const BoundsJob job =
      this->job(inertial(4, "0.9 0 0", 0.02) + box_geometry,
                inertial(2, "0 0 0.1", 0.004) +
                    R"(<collision><geometry><mesh filename="nowhere.stl"/></geometry></collision>)");
  const BoundsReport report = run(job);
  ASSERT_EQ(report.notes.size(), 2U);
  EXPECT_NE(report.notes[0].find("'upper': its centre of mass lies outside"), std::string::npos);
  EXPECT_NE(report.notes[1].find("nowhere.stl"), std::string::npos);
  const Bounds bounds = read_back(report);
  EXPECT_TRUE(bounds.constraints.empty());
  for (const ConstraintMargin& c : constraint_margins(bounds, links_of(job.robot)))
    EXPECT_GE(c.margin, -1e-12) << c.name;
}

/// A URDF of kinematics alone needs a weight, and says which link asks for it.
TEST_F(BoundsOfAFile, WithoutInertialsNeedATotalMass) {
  BoundsJob job = this->job(box_geometry, "");
  try {
    run(job);
    ADD_FAILURE() << "not refused";
  } catch (const OptionError& error) {
    EXPECT_EQ(error.option(), "total_mass");
    EXPECT_NE(error.rule().find("'upper'"), std::string::npos) << error.rule();
  }
  job.total_mass = Eigen::Vector2d(5.0, 7.0);
  const BoundsReport report = run(job);
  const Bounds bounds = read_back(report);
  EXPECT_EQ(bounds.upper[0], 7.0);
  EXPECT_EQ(bounds.lower[10], 0.0);
  EXPECT_EQ(bounds.total_mass_upper, 7.0);
}

TEST_F(BoundsOfAFile, RefuseByName) {
  const BoundsJob good = job(inertial(4, "0.2 0 0", 0.02) + box_geometry, inertial(2, "0 0 0.1", 0.004));
  const auto refused = [](const BoundsJob& job) -> std::string {
    try {
      run(job);
    } catch (const OptionError& error) {
      return error.option();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  BoundsJob job = good;
  job.mass_factor = 1.0;
  EXPECT_EQ(refused(job), "mass_factor");
  job = good;
  job.com_margin = 0.0;
  EXPECT_EQ(refused(job), "com_margin");
  job = good;
  job.total_mass = Eigen::Vector2d(3.0, 2.0);
  EXPECT_EQ(refused(job), "total_mass");
  job.total_mass = Eigen::Vector2d(0.1, 0.2);  // a tenth of what the links weigh at least
  EXPECT_NE(refused(job).find("eq. (30)"), std::string::npos);
}

/// Any robot will do: the published Panda, which has no geometry.
TEST_F(BoundsOfAFile, OfAModelWithoutGeometry) {
  BoundsJob job;
  job.source = std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml";
  job.robot = read_robot(job.source);
  const BoundsReport report = run(job);
  EXPECT_EQ(report.with_geometry, 0);
  for (const ConstraintMargin& c : constraint_margins(read_back(report), links_of(job.robot)))
    EXPECT_GE(c.margin, -1e-12) << c.name;
}

}  // namespace
}  // namespace dynid
