// SPDX-License-Identifier: Apache-2.0
// `dynid identify --servo` and `dynid replay` from outside.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dynid/base/file.hpp"
#include "dynid/dynamics/servo_joint.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class ServoCommands : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_servo_") + test->name());
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

  /// Two equal servos under two chirps; positions to an encoder's step.
  void write_servo_log(const std::string& name, double pace) const {
    ServoJoint joint;
    joint.inertia = 1.0 / 400.0, joint.damping = 0.08, joint.coulomb = 0.01, joint.bias = 0.02,
    joint.delay = 0.03;
    Log log;
    log.t = Eigen::VectorXd::LinSpaced(1500, 0.0, 1499 / 50.0);
    log.u.resize(1500, 2);
    log.q = log.u;
    for (int j = 0; j < 2; ++j) {
      for (Eigen::Index i = 0; i < 1500; ++i)
        log.u(i, j) = 0.3 * std::sin((pace + 0.3 * j) * log.t[i] * (1.0 + 0.1 * log.t[i]));
      const HeldCommand held(log.t, log.u.col(j));
      ServoState<false> state(0.0, 0.0, log.u(0, j));
      Eigen::Index hint = 0;
      ServoInput in;
      for (Eigen::Index i = 0; i < 1500; ++i) {
        log.q(i, j) = 0.0015 * std::round(state.q / 0.0015);
        for (int k = 0; k < 20; ++k) {
          held.fill(log.t[i] + 0.001 * k, 0.001, joint.delay, hint, in);
          state.step(joint, in);
        }
      }
    }
    write_log(path(name), log);
  }

  fs::path folder_;
  std::string out_, error_;
};

TEST_F(ServoCommands, IdentifyThenReplay) {
  write_servo_log("a.csv", 1.0);
  write_servo_log("b.csv", 1.7);
  write_servo_log("c.csv", 2.3);
  ASSERT_EQ(run("identify --servo --log " + path("a.csv") + " " + path("b.csv") + " --out " + path("m.yaml") +
                " --json " + path("i.json") + " --quiet"),
            0)
      << error_;
  const auto fit = nlohmann::json::parse(read_file(path("i.json")));
  ASSERT_EQ(fit["joints"].size(), 2u);
  for (const auto& joint : fit["joints"]) {
    EXPECT_FALSE(joint["si"]);
    EXPECT_NEAR(joint["parameters"]["natural_frequency"]["value"].get<double>(), 20.0, 2.0);
    EXPECT_NEAR(joint["parameters"]["delay"]["value"].get<double>(), 0.03, 0.004);
    EXPECT_FALSE(joint["aliases"].empty());
    EXPECT_LT(joint["error"].get<double>(), 0.002);
  }
  ASSERT_EQ(run("replay --model " + path("m.yaml") + " --log " + path("c.csv") + " --out " + path("p.csv") +
                " --json -"),
            0)
      << error_;
  const auto replay = nlohmann::json::parse(out_);
  const Table motion = read_table(path("p.csv"));
  EXPECT_EQ(motion.values.rows(), 1500);
  EXPECT_EQ(motion.names, (std::vector<std::string>{"t", "q1", "q2", "dq1", "dq2"}));
  LogColumns columns;
  columns.dq = columns.tau = false;
  const Log log = read_log(path("c.csv"), 2, columns);
  const Eigen::VectorXd error = (motion.group("q", 2, true) - log.q).cwiseAbs().colwise().mean().transpose();
  for (int j = 0; j < 2; ++j) {
    EXPECT_NEAR(replay["error"][static_cast<std::size_t>(j)].get<double>(), error[j], 1e-12);
    EXPECT_LT(error[j], 0.002);
  }
}

TEST_F(ServoCommands, RefuseInOneLine) {
  write_servo_log("a.csv", 1.0);
  LogColumns columns;
  columns.dq = columns.tau = false;
  Log log = read_log(path("a.csv"), 2, columns);
  log.u.resize(0, 0);
  write_log(path("no_commands.csv"), log);
  EXPECT_EQ(run("identify --servo --log " + path("no_commands.csv") + " --out " + path("m.yaml")), 2);
  EXPECT_NE(error_.find("u1..u2 are missing"), std::string::npos) << error_;
  EXPECT_FALSE(fs::exists(path("m.yaml")));
  EXPECT_EQ(
      run("replay --model " + std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml --log " + path("a.csv")),
      2);
  EXPECT_EQ(run("identify --log " + path("a.csv")), 2);
  EXPECT_NE(error_.find("--robot is required"), std::string::npos) << error_;
}

TEST_F(ServoCommands, HelpHasAnExample) {
  ASSERT_EQ(run("replay --help"), 0);
  EXPECT_NE(out_.find("Example: dynid replay"), std::string::npos);
  ASSERT_EQ(run("identify --help"), 0);
  EXPECT_NE(out_.find("identify --servo"), std::string::npos);
}

}  // namespace
}  // namespace dynid
