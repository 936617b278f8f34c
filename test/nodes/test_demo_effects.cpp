// SPDX-License-Identifier: Apache-2.0
// launch/demo.launch with every effect of the catalogue that makes sense there: it ends well. The exciting
// motion, short, is looked for once and played by all. Run by demo_effects.test.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynid/effect/catalogue.hpp"
#include "dynid/effect/parse.hpp"
#include "dynid/model/robot_file.hpp"
#include "time_scale.hpp"

namespace {

namespace fs = std::filesystem;
using dynid::EffectSchema;
using dynid::EffectScope;

const char model[] = DYNID_SOURCE_DIR "/config/panda.yaml";

/// Why the demo cannot show the effect; empty: it can.
std::string out_of_place(const EffectSchema& schema) {
  // The demo makes its log itself, and nobody knows before at which of its stamps.
  return schema.scope == EffectScope::window ? schema.not_in_loop : "";
}

/// As large as the catalogue has it, on joints that move and carry something.
std::string argument(const EffectSchema& schema) {
  switch (schema.scope) {
    case EffectScope::joints:
      return schema.name + ":joints=2+4" + (schema.name == "stribeck_friction" ? ",static=2" : "");
    case EffectScope::pair:
      return schema.name + ":joints=2+4";
    case EffectScope::link:
      return schema.name + ":joints=4";
    case EffectScope::arm:
    case EffectScope::window:
      break;
  }
  return schema.name;
}

/// What the launch file says, and its exit status; in the master that the test was started with.
std::string launch(const std::string& arguments, int& status) {
  const std::string command =
      "roslaunch dynid demo.launch headless:=true retrieve:=false false_alarms_per_hour:=0 rest:=0.4 "
      "push_duration:=0.6 approach_velocity:=1 patience:=" +
      std::to_string(180.0 * dynid::test::time_scale()) + " " + arguments + " 2>&1";
  std::string story;
  FILE* const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return "roslaunch cannot be started";
  char line[4096];
  while (fgets(line, sizeof line, pipe) != nullptr) story += line;
  const int end = pclose(pipe);
  status = WIFEXITED(end) ? WEXITSTATUS(end) : -1;
  return story;
}

class DemoOfEffects : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() {
    std::string name = (fs::temp_directory_path() / "dynid_demo_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  static void TearDownTestSuite() {
    if (!testing::UnitTest::GetInstance()->Failed()) fs::remove_all(folder_);
  }
  /// The arguments that name the motion: the first demo that finds one leaves it to the others.
  static std::string motion(const fs::path& out) {
    if (!motion_.empty()) return " trajectory:=" + motion_.string();
    motion_ = out / "trajectory.csv";
    return " period:=5";
  }

  static fs::path folder_, motion_;
};
fs::path DemoOfEffects::folder_, DemoOfEffects::motion_;

TEST_P(DemoOfEffects, EndsWell) {
  const EffectSchema& schema = dynid::effect_schema(GetParam());
  if (const std::string reason = out_of_place(schema); !reason.empty())
    GTEST_SKIP() << schema.name << " makes no sense in the demo: it depends on " << reason;
  const std::string effect = argument(schema);
  ASSERT_NO_THROW(dynid::parse_effect(effect, dynid::read_model_file(model).robot)) << effect;

  const fs::path out = folder_ / schema.name;
  int status = -1;
  const std::string story = launch("effect:=" + effect + " out:=" + out.string() + motion(out), status);
  EXPECT_EQ(status, 0) << story;
  std::ifstream file(out / "summary.json");
  ASSERT_TRUE(file) << story;
  const nlohmann::json s = nlohmann::json::parse(file);
  ASSERT_EQ(s.at("ok"), true) << story << s.dump(2);
  ASSERT_TRUE(fs::exists(motion_)) << story;

  // It is a gap of a log that can be judged, and the motion is rich enough for the arm to be identified.
  const std::string verdict = s.at("diagnosis").at("verdict");
  EXPECT_NE(verdict, "data_invalid") << story;
  EXPECT_NE(verdict, "misread") << story;
  EXPECT_GT(s.at("identified").at("rank"), 0) << story;
  std::string found;
  for (const nlohmann::json& e : s.at("diagnosis").at("effects")) {
    EXPECT_NE(dynid::find_effect_schema(e.at("name")), nullptr) << e.dump(2);
    found += " " + e.at("name").get<std::string>();
  }
  EXPECT_EQ(s.at("push").at("contact"), true) << story;
  std::printf("%s: %s,%s; %.1f s\n", effect.c_str(), verdict.c_str(), found.empty() ? " -" : found.c_str(),
              s.at("seconds").get<double>());
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const EffectSchema& schema : dynid::effect_schemas()) all.push_back(schema.name);
  return all;
}
INSTANTIATE_TEST_SUITE_P(Catalogue, DemoOfEffects, testing::ValuesIn(names()),
                         [](const auto& effect) { return effect.param; });

TEST(DemoEffects, AllButThoseBoundToTheStampsOfOneLog) {
  for (const EffectSchema& schema : dynid::effect_schemas()) {
    const bool start = schema.find("start") != nullptr;
    EXPECT_EQ(!out_of_place(schema).empty(), start) << schema.name;
  }
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
