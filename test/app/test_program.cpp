// SPDX-License-Identifier: Apache-2.0
// The program says what the use cases say, and ends when it is told to.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "app/serialise.hpp"
#include "app/small_problems.hpp"
#include "dynid/app/uncertainty.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

/// As text has it, and without what differs from run to run.
nlohmann::json plain(const nlohmann::json& value) {
  const std::function<void(nlohmann::json&)> clean = [&](nlohmann::json& v) {
    if (v.is_object()) v.erase("seconds");
    if (v.is_structured())
      for (nlohmann::json& inner : v) clean(inner);
  };
  nlohmann::json result = nlohmann::json::parse(value.dump());
  clean(result);
  return result;
}

class Program : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_app_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  /// The JSON of `dynid arguments`.
  nlohmann::json json_of(const std::string& arguments) const {
    const std::string command =
        std::string(DYNID_PROGRAM) + " " + arguments + " --quiet --json " + path("out.json");
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return nlohmann::json::parse(read_file(path("out.json")));
  }

  const std::string panda_ = std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml";
  const std::string bounds_ = std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml";
  fs::path folder_;
};

TEST_F(Program, SaysWhatTheUseCasesSay) {
  const Robot panda = read_robot(panda_);
  EXPECT_EQ(plain(json_of("info --robot " + panda_)), plain(to_json(run(InfoJob{panda}))));

  write_log(path("log.csv"), test::small_log());
  const Log log = read_log(path("log.csv"), 7);
  IdentifyJob identify;
  identify.robot = panda;
  identify.source = panda_;
  identify.logs = {log};
  identify.options.prepare.cutoff = 10.0;
  const IdentifyReport identified = run(identify);
  EXPECT_EQ(plain(json_of("identify --cutoff 10 --robot " + panda_ + " --log " + path("log.csv") + " --out " +
                          path("m.yaml"))),
            plain(to_json(identified)));
  EXPECT_EQ(read_file(path("m.yaml")),
            to_yaml(identified.model(), uncertainty_of(identify, identified).uncertainty));

  const FrictionReport friction = run(FrictionJob{panda, panda_, {log}, identify.options, ""});
  EXPECT_EQ(
      plain(json_of("identify --friction-only --cutoff 10 --robot " + panda_ + " --log " + path("log.csv"))),
      plain(to_json(friction)));

  TorqueJob torque{panda, log};
  nlohmann::json expected = to_json(run(torque));
  expected["out"] = path("t.csv");
  EXPECT_EQ(
      plain(json_of("torque --model " + panda_ + " --log " + path("log.csv") + " --out " + path("t.csv"))),
      plain(expected));

  RetrieveJob retrieve;
  retrieve.model = read_model_file(path("m.yaml"), "", "", Consistency::ignore);
  retrieve.source = path("m.yaml");
  retrieve.bounds = read_bounds(bounds_);
  retrieve.options.runs = 1;
  retrieve.options.steps = 2;
  const RetrieveReport retrieved = run(retrieve);
  EXPECT_EQ(plain(json_of("retrieve --runs 1 --steps 2 --model " + path("m.yaml") + " --bounds " + bounds_ +
                          " --out " + path("f.yaml"))),
            plain(to_json(retrieved)));
  EXPECT_EQ(read_file(path("f.yaml")), to_yaml(retrieved.model(), read_uncertainty(path("m.yaml"))));

  DiagnoseJob diagnose;
  diagnose.nominal = panda;
  diagnose.logs = {log};
  EXPECT_EQ(plain(json_of("diagnose --model " + panda_ + " --log " + path("log.csv"))),
            plain(to_json(run(diagnose))));

  SimulateJob simulate;
  simulate.robot = panda;
  simulate.duration = 2.0;
  simulate.rate = 100.0;
  simulate.effects = parse_effects({"payload:mass=1,com=0:0:0.1"}, panda);
  expected = to_json(run(simulate));
  expected["out"] = path("s.csv");
  EXPECT_EQ(plain(json_of("simulate --excite --duration 2 --rate 100 --effect payload:mass=1,com=0:0:0.1 "
                          "--model " +
                          panda_ + " --out " + path("s.csv"))),
            plain(expected));

  const ExciteJob excite = test::excite_job();
  expected = to_json(run(excite));
  expected["out"] = path("motion.csv");
  EXPECT_EQ(plain(json_of("excite --collision none --starts 2 --effort 20 --rate 100 --robot " + panda_ +
                          " --out " + path("motion.csv"))),
            plain(expected));
}

/// Law: Ctrl-C ends a long command with 130 and leaves no file of it.
TEST_F(Program, EndsWithCtrlC) {
  const std::string bank = path("bank"), json = path("b.json");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    execl(DYNID_PROGRAM, DYNID_PROGRAM, "blind", "--quiet", "--cases", "100000", "--model", panda_.c_str(),
          "--folder", bank.c_str(), "--json", json.c_str(), nullptr);
    _exit(127);
  }
  // Once a case is under way.
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  const auto under_way = [&] {
    std::error_code ignored;
    return fs::exists(bank + "/sealed", ignored) && !fs::is_empty(bank + "/sealed", ignored);
  };
  while (!under_way() && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(under_way());
  EXPECT_EQ(kill(child, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << status;
  EXPECT_EQ(WEXITSTATUS(status), 130);
  for (const auto& entry : fs::directory_iterator(folder_))
    EXPECT_EQ(entry.path().filename(), "bank") << entry.path();
}

}  // namespace
}  // namespace dynid
