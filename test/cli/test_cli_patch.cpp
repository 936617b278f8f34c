// SPDX-License-Identifier: Apache-2.0
// From logs to a patched model and back, from outside: simulate, diagnose, torque, simulate.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dynid/base/file.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class PatchCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("dynid_patch_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
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

  double torque_error(const std::string& model, const std::string& log) {
    EXPECT_EQ(run("torque --quiet --model " + model + " --log " + path(log) + " --out " + path("t.csv") +
                  " --json " + path("t.json")),
              0)
        << error_;
    double sum = 0.0;
    const auto json = nlohmann::json::parse(read_file(path("t.json")));
    for (const double x : json["rms_difference"]) sum += x * x;
    return std::sqrt(sum);
  }

  const std::string panda_ = std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml";
  fs::path folder_;
  std::string error_;
};

TEST_F(PatchCommand, PredictsSimulatesAndReports) {
  for (const char* seed : {"1", "2", "3"})
    ASSERT_EQ(run("simulate --quiet --excite --duration 12 --rate 250 --clean --noise 0.3 --effect "
                  "joint_spring:joints=2+4,stiffness=12,rest=0.3 --effect time_delay:delay_s=0.015 --model " +
                  panda_ + " --seed " + seed + " --out " + path(std::string("l") + seed + ".csv")),
              0)
        << error_;
  ASSERT_EQ(run("diagnose --quiet --model " + panda_ + " --log " + path("l1.csv") + " " + path("l2.csv") +
                " --patch " + path("p.yaml") + " --report " + path("r.html") + " --json " + path("d.json")),
            0)
      << error_;
  const auto d = nlohmann::json::parse(read_file(path("d.json")));
  std::string names;
  for (const auto& e : d["effects"]) names += std::string(e["name"]) + " ";
  const double before = torque_error(panda_, "l3.csv"), after = torque_error(path("p.yaml"), "l3.csv");
  EXPECT_LT(after, 0.3 * before) << names;
  ASSERT_EQ(d["shrink"]["rollout"]["horizon_s"].size(), 3u);
  EXPECT_LT(d["shrink"]["rollout"]["after"][1], d["shrink"]["rollout"]["before"][1]);
  EXPECT_FALSE(std::string(d["next_experiment"]["text"]).empty());
  EXPECT_NE(read_file(path("r.html")).find("dynid diagnose --model"), std::string::npos);

  ASSERT_EQ(run("simulate --quiet --excite --duration 6 --rate 250 --clean --noise 0.3 --seed 4 --model " +
                path("p.yaml") + " --out " + path("l4.csv")),
            0)
      << error_ << names;
  EXPECT_LT(torque_error(path("p.yaml"), "l4.csv"), 0.3 * torque_error(panda_, "l4.csv"));
}

}  // namespace
}  // namespace dynid
