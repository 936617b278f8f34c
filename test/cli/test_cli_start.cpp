// SPDX-License-Identifier: Apache-2.0
// The commands that make the files to begin with, and the one that compares: from outside.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "dynid/base/file.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class Start : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("dynid_start_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string panda() { return std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml"; }

  /// Runs `dynid arguments` in the folder.
  int run(const std::string& arguments) {
    const std::string command =
        "cd " + folder_.string() + " && " DYNID_PROGRAM " " + arguments + " >stdout 2>stderr";
    const int status = std::system(command.c_str());
    out_ = read_file(path("stdout"));
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  /// Exit 2, one line of error with `part`, and nothing written to `out`.
  void expect_refused(const std::string& arguments, const std::string& part, const std::string& out) {
    EXPECT_EQ(run(arguments), 2) << arguments;
    EXPECT_NE(error_.find(part), std::string::npos) << error_;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
    EXPECT_FALSE(fs::exists(path(out))) << arguments;
  }

  fs::path folder_;
  std::string out_, error_;
};

TEST_F(Start, InitMakesAModelThatTheOtherCommandsRead) {
  write_file(path("table.csv"), "a,alpha,d\n0,0,0.333\n0,-90,0\n0,90,0.316\n");
  ASSERT_EQ(run("init --dh table.csv --degrees --name arm --names pan,lift,roll --out arm.yaml"), 0)
      << error_;
  EXPECT_NE(out_.find("3 joints written to arm.yaml"), std::string::npos) << out_;
  ASSERT_EQ(run("info --robot arm.yaml --json -"), 0) << error_;
  EXPECT_NE(out_.find("lift"), std::string::npos);
  expect_refused("init --dh table.csv --types RR --out x.yaml", "--types: 'RR'", "x.yaml");
  expect_refused("init --dh nowhere.csv --out x.yaml", "nowhere.csv", "x.yaml");
  expect_refused("init --dh table.csv --convention other --out x.yaml", "--convention", "x.yaml");
}

TEST_F(Start, BoundsAreWhatRetrieveTakes) {
  ASSERT_EQ(run("export --model " + panda() + " --format urdf --out arm.urdf"), 0) << error_;
  ASSERT_EQ(run("bounds --robot arm.urdf --out bounds.yaml --json bounds.json"), 0) << error_;
  const nlohmann::json json = nlohmann::json::parse(read_file(path("bounds.json")));
  EXPECT_EQ(json.at("links"), 7);
  EXPECT_EQ(json.at("with_mass"), 7);
  ASSERT_EQ(run("simulate --model " + panda() + " --excite --duration 10 --rate 250 --seed 1 --out log.csv"),
            0);
  ASSERT_EQ(run("identify --robot arm.urdf --log log.csv --out identified.yaml --quiet"), 0) << error_;
  ASSERT_EQ(
      run("retrieve --model identified.yaml --bounds bounds.yaml --runs 1 --steps 2 --json feasible.json "
          "--out feasible.yaml"),
      0)
      << error_;
  EXPECT_TRUE(nlohmann::json::parse(read_file(path("feasible.json"))).at("feasible").get<bool>());
  expect_refused("bounds --robot arm.urdf --mass-factor 0.5 --out x.yaml", "--mass-factor: 0.5", "x.yaml");
  expect_refused("bounds --robot arm.urdf --total-mass 1,2 --out x.yaml", "eq. (30)", "x.yaml");
}

TEST_F(Start, CompareTakesWhatDiagnoseWrites) {
  const std::string simulate = "simulate --model " + panda() + " --excite --duration 8 --rate 250 --seed ";
  ASSERT_EQ(run(simulate + "5 --out good.csv"), 0);
  ASSERT_EQ(run(simulate + "5 --effect viscous_friction:joints=2,coefficient=3 --out bad.csv"), 0);
  const std::string diagnose = "diagnose --quiet --model " + panda() + " --log ";
  ASSERT_EQ(run(diagnose + "bad.csv --json bad.json"), 0) << error_;
  ASSERT_EQ(run(diagnose + "good.csv --json good.json"), 0) << error_;
  ASSERT_EQ(run("compare bad.json good.json --report page.html --json compared.json"), 0) << error_;
  EXPECT_NE(out_.find("gone: viscous friction on joint 2"), std::string::npos) << out_;
  EXPECT_NE(read_file(path("page.html")).find("Gone: viscous friction on joint 2"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(read_file(path("compared.json"))).at("format"), "dynid-comparison-1");
  expect_refused("compare bad.json --report x.html", "diagnoses", "x.html");
  expect_refused("compare bad.json compared.json --report x.html", "compared.json: expected", "x.html");
}

}  // namespace
}  // namespace dynid
