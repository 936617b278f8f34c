// SPDX-License-Identifier: Apache-2.0
// `dynid excite` from outside.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "dynid/base/file.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class ExciteCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_excite_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  int run(const std::string& arguments, const std::string& robot = DYNID_SOURCE_DIR "/config/panda.yaml") {
    const std::string command = std::string(DYNID_PROGRAM) + " excite --robot " + robot + " --out " +
                                path("motion.csv") + " " + arguments + " >" + path("stdout") + " 2>" +
                                path("stderr");
    const int status = std::system(command.c_str());
    out_ = read_file(path("stdout"));
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void expect_refused(const std::string& arguments, const std::string& part,
                      const std::string& robot = DYNID_SOURCE_DIR "/config/panda.yaml") {
    EXPECT_EQ(run(arguments, robot), 2) << arguments;
    EXPECT_NE(error_.find(part), std::string::npos) << error_;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
    EXPECT_FALSE(fs::exists(path("motion.csv"))) << arguments;
  }

  fs::path folder_;
  std::string out_, error_;
};

TEST_F(ExciteCommand, WritesAMotionItsMessageAndItsMargins) {
  const std::string quick = " --starts 1 --effort 30 --rate 100";
  ASSERT_EQ(run("--joint-trajectory " + path("message.yaml") + " --json " + path("e.json") + quick), 0)
      << error_;
  EXPECT_NE(out_.find("condition number"), std::string::npos) << out_;
  const Trajectory motion = read_trajectory(path("motion.csv"), 7);
  EXPECT_EQ(motion.samples(), 2101);
  EXPECT_EQ(motion.dq.row(0).norm() + motion.ddq.row(2100).norm(), 0.0);
  EXPECT_EQ(YAML::LoadFile(path("message.yaml"))["points"].size(), 2101u);
  const auto json = nlohmann::json::parse(read_file(path("e.json")));
  EXPECT_EQ(json["columns"], 64);
  EXPECT_TRUE(json["feasible"]);
  EXPECT_EQ(json["margins"].size(), 37u);
  for (const auto& margin : json["margins"]) EXPECT_GT(margin["margin"], 0.0) << margin;
  EXPECT_GE(json["limiting"]["share"], 0.0);

  // The same motion by way of its file has the same condition number, but for the rate.
  ASSERT_EQ(run("--quiet --seed 2 --json - --compare " + path("motion.csv") + quick), 0) << error_;
  const auto other = nlohmann::json::parse(out_);
  EXPECT_NEAR(other["compare"]["condition_number"], json["condition_number"],
              0.02 * json["condition_number"].get<double>());
  EXPECT_NE(other["condition_number"], json["condition_number"]);
}

TEST_F(ExciteCommand, RefusesInOneLine) {
  expect_refused("--harmonics 0", "--harmonics");
  expect_refused("--period -1", "--period");
  expect_refused("--kind square", "--kind");
  expect_refused("--collision /no/such.yaml", "/no/such.yaml");
  expect_refused("--compare /no/such.csv", "/no/such.csv");
  expect_refused("--joint-trajectory /no/such/folder/m.yaml", "/no/such/folder");
  std::string text = read_file(DYNID_SOURCE_DIR "/config/panda.yaml");
  const std::string jerk = "jerk: 5000";
  text.replace(text.find(jerk), jerk.size(), "jerk: 1e-6");
  write_file(path("stiff.yaml"), text);
  expect_refused("", "joint 3 ('panda_joint3'): the jerk limit lets it move by at most", path("stiff.yaml"));
}

TEST_F(ExciteCommand, EndsWithOneWhereNoMotionIsFound) {
  // A lid over the arm that single poses avoid: ten evaluations find no way of moving under it.
  std::string shape = read_file(DYNID_SOURCE_DIR "/config/panda_collision.yaml");
  shape +=
      "boxes:\n  - {name: lid, xyz: [0, 0, 0.72], size: [2, 2, 0.02]}\n  - {name: wall, xyz: [0.25, 0, 0.5], "
      "size: [0.02, 2, 1]}\n";
  write_file(path("cage.yaml"), shape);
  const int status = run("--starts 1 --effort 10 --collision " + path("cage.yaml"));
  EXPECT_EQ(status, 1) << out_ << error_;
  EXPECT_NE(error_.find("no motion found within the limits"), std::string::npos) << error_;
  EXPECT_FALSE(fs::exists(path("motion.csv")));
}

}  // namespace
}  // namespace dynid
