// SPDX-License-Identifier: Apache-2.0
// `dynid simulate` from outside.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dynid/base/file.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class SimulateCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_simulate_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  int run(const std::string& arguments) {
    const std::string command =
        std::string(DYNID_PROGRAM) + " " + arguments + " >" + path("stdout") + " 2>" + path("stderr");
    const int status = std::system(command.c_str());
    out_ = read_file(path("stdout"));
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  const std::string panda_ = std::string(" --model ") + DYNID_SOURCE_DIR + "/config/panda.yaml ";
  fs::path folder_;
  std::string out_, error_;
};

TEST_F(SimulateCommand, ListsTheEffects) {
  ASSERT_EQ(run("simulate --effects"), 0) << error_;
  EXPECT_NE(out_.find("joint_elasticity"), std::string::npos);
  ASSERT_EQ(run("simulate --effects --json -"), 0) << error_;
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["effects"].size(), 22u);
  for (const auto& effect : json["effects"])
    for (const auto& parameter : effect["parameters"])
      EXPECT_FALSE(parameter["unit"].empty()) << effect["name"];
}

TEST_F(SimulateCommand, TorquePredictsACleanLog) {
  ASSERT_EQ(
      run("simulate --excite --duration 5 --clean --noise 0 --quiet" + panda_ + "--out " + path("l.csv")), 0)
      << error_;
  ASSERT_EQ(run("torque" + panda_ + "--log " + path("l.csv") + " --out " + path("t.csv")), 0) << error_;
  const Table log = read_table(path("l.csv")), predicted = read_table(path("t.csv"));
  EXPECT_EQ(log.values.rows(), 5001);
  EXPECT_LT((log.group("tau", 7, true) - predicted.group("tau", 7, true)).cwiseAbs().maxCoeff(), 1e-3);
}

TEST_F(SimulateCommand, WritesLogAndLabels) {
  const std::string command = "simulate --excite --duration 4 --rate 250 --seed 3" + panda_ +
                              "--effect payload:mass=2,com=0:0.01:0.1 "
                              "--effect viscous_friction:joints=2+4,coefficient=0.8:0.5 --labels " +
                              path("labels.json") + " --json " + path("s.json") + " --out ";
  ASSERT_EQ(run(command + path("a.csv")), 0) << error_;
  ASSERT_EQ(run(command + path("b.csv")), 0) << error_;
  EXPECT_EQ(read_file(path("a.csv")), read_file(path("b.csv")));  // the same for a seed
  EXPECT_EQ(read_log(path("a.csv"), 7).samples(), 1001);
  const auto labels = nlohmann::json::parse(read_file(path("labels.json")));
  ASSERT_EQ(labels.size(), 2u);
  EXPECT_EQ(labels[0]["name"], "payload");
  EXPECT_EQ(labels[0]["parameters"]["mass"], 2.0);
  EXPECT_EQ(labels[1]["joints"], (std::vector<int>{2, 4}));
  EXPECT_EQ(labels[1]["parameters"]["coefficient"], (std::vector<double>{0, 0.8, 0, 0.5, 0, 0, 0}));
  const auto json = nlohmann::json::parse(read_file(path("s.json")));
  EXPECT_EQ(json["effects"], labels);
  EXPECT_EQ(json["effect_torque_rms"].size(), 2u);
  EXPECT_EQ(json["samples"], 1001);
}

TEST_F(SimulateCommand, BadUsageIsOneLineAndTwo) {
  const std::string out = " --out " + path("out.csv");
  const std::pair<std::string, std::string> cases[] = {
      {"simulate" + panda_ + out, "--excite"},
      {"simulate --excite" + out, "--model"},
      {"simulate --excite" + panda_, "--out"},
      {"simulate --excite --effect rust" + panda_ + out, "'rust': unknown"},
      {"simulate --excite --effect payload:weight=1" + panda_ + out, "'weight'"},
      {"simulate --excite --effect payload:mass=heavy" + panda_ + out, "'heavy' is not a number"},
      {"simulate --excite --rate 333" + panda_ + out, "rate"},
      {"simulate --trajectory " + path("none.csv") + panda_ + out, "none.csv"}};
  for (const auto& [arguments, part] : cases) {
    EXPECT_EQ(run(arguments), 2) << arguments;
    EXPECT_NE(error_.find(part), std::string::npos) << arguments << "\n" << error_;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
    EXPECT_FALSE(fs::exists(path("out.csv"))) << arguments;
  }
}

}  // namespace
}  // namespace dynid
