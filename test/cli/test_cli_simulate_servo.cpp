// SPDX-License-Identifier: Apache-2.0
// `dynid simulate --servo` and `dynid blind --servo` from outside.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dynid/base/file.hpp"
#include "dynid/diagnosis/servo_blind.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class SimulateServo : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_simulate_servo_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const Robot panda = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
    write_model(path("arm.yaml"), {with_random_servos(panda, 3), {}, {}});
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  int run(const std::string& arguments) {
    const std::string command =
        std::string(DYNID_PROGRAM) + " " + arguments + " >" + path("stdout") + " 2>" + path("stderr");
    const int status = std::system(command.c_str());
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string simulate(const std::string& options) const {
    return "simulate --servo --model " + path("arm.yaml") + " --excite --duration 15 " + options;
  }

  fs::path folder_;
  std::string error_;
};

TEST_F(SimulateServo, WritesCommandsAndPositionsThatAreDiagnosed) {
  const std::string hidden = "--effect servo_stiffness:joints=4,factor=0.6 ";
  ASSERT_EQ(run(simulate(hidden + "--seed 1 --out " + path("a.csv") + " --labels " + path("labels.json"))), 0)
      << error_;
  ASSERT_EQ(run(simulate(hidden + "--seed 2 --out " + path("b.csv"))), 0) << error_;
  LogColumns columns;
  columns.dq = columns.tau = false;
  const Log log = read_log(path("a.csv"), 7, columns);
  EXPECT_EQ(log.u.rows(), log.q.rows());
  EXPECT_EQ(log.dq.rows(), log.q.rows());
  EXPECT_EQ(log.tau.size(), 0);
  EXPECT_NEAR(log.t[1], 0.01, 1e-12);
  const auto labels = nlohmann::json::parse(read_file(path("labels.json")));
  ASSERT_EQ(labels.size(), 1U);
  EXPECT_EQ(labels[0]["name"], "servo_stiffness");
  EXPECT_EQ(labels[0]["joints"], std::vector<int>{4});
  ASSERT_EQ(run("diagnose --model " + path("arm.yaml") + " --log " + path("a.csv") + " " + path("b.csv") +
                " --quiet --json " + path("gap.json")),
            0)
      << error_;
  const auto gap = nlohmann::json::parse(read_file(path("gap.json")));
  ASSERT_FALSE(gap["effects"].empty());
  EXPECT_EQ(gap["effects"][0]["name"], "servo_stiffness");
  EXPECT_EQ(gap["effects"][0]["joints"], std::vector<int>{4});
}

TEST_F(SimulateServo, HasTorquesWhereAsked) {
  ASSERT_EQ(run(simulate("--torque --rate 50 --out " + path("a.csv"))), 0) << error_;
  EXPECT_EQ(read_log(path("a.csv"), 7).tau.cols(), 7);
}

TEST_F(SimulateServo, SaysWhatIsWrongAndWritesNothing) {
  const auto refused = [&](const std::string& arguments, const char* what) {
    EXPECT_EQ(run(arguments), 2) << arguments;
    EXPECT_NE(error_.find(what), std::string::npos) << error_;
    EXPECT_FALSE(fs::exists(path("a.csv")));
  };
  const std::string out = " --out " + path("a.csv");
  refused("simulate --servo --excite --model " + std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml" + out,
          "has no servo");
  refused(simulate("--effect servo_stiffness:joints=2,stiff=3" + out), "no parameter is called 'stiff'");
  refused(simulate("--effect nonsense" + out), "unknown");
  refused("simulate --model " + path("arm.yaml") + " --excite --effect servo_stiffness" + out, "unknown");
  refused("simulate --torque --model " + path("arm.yaml") + " --excite" + out, "--servo");
}

TEST_F(SimulateServo, ABankIsScored) {
  ASSERT_EQ(run("blind --servo --family --cases 2 --seed 4 --model " + path("arm.yaml") + " --quiet --json " +
                path("blind.json")),
            0)
      << error_;
  const auto blind = nlohmann::json::parse(read_file(path("blind.json")));
  EXPECT_EQ(blind["cases"].get<int>() + blind["failures"].get<int>(), 2);
  EXPECT_EQ(blind["failures"], 0);
  ASSERT_EQ(blind["list"].size(), 2U);
  for (const char* key : {"first_right", "healthy_confident", "confident_not_there", "intervals", "covered"})
    EXPECT_TRUE(blind.contains(key)) << key;
  EXPECT_EQ(run("blind --servo --cases 2 --kind vendor --model " + path("arm.yaml")), 2);
}

}  // namespace
}  // namespace dynid
