// SPDX-License-Identifier: Apache-2.0
// launch/demo.launch from its start to its own end, with a payload other than the default one: run by
// demo.test.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "time_scale.hpp"

namespace {

double norm(const nlohmann::json& values) {
  double sum = 0.0;
  for (const double x : values) sum += x * x;
  return std::sqrt(sum);
}

TEST(Demo, FindsTheHiddenPayloadAllByItself) {
  std::string folder = (std::filesystem::temp_directory_path() / "dynid_demo_XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  // In the master that the test was started with.
  const std::string command =
      "roslaunch dynid demo.launch headless:=true effect:=payload:mass=1.8,com=-0.03:0.02:0.1 out:=" +
      folder + " patience:=" + std::to_string(180.0 * dynid::test::time_scale()) + " 2>&1";
  FILE* const pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string story;
  char line[4096];
  while (fgets(line, sizeof line, pipe) != nullptr) {
    story += line;
    std::fputs(line, stdout);
  }
  pclose(pipe);

  std::ifstream file(folder + "/summary.json");
  ASSERT_TRUE(file) << story;
  const nlohmann::json s = nlohmann::json::parse(file);
  ASSERT_EQ(s.at("ok"), true) << s.dump(2);

  // Before: the load is taken for somebody who pulls. After: it is known.
  const double before = norm(s.at("rest_before").at("residual")),
               after = norm(s.at("rest_after").at("residual"));
  EXPECT_GT(before, 5.0);
  EXPECT_LT(after, 0.1 * before);
  EXPECT_EQ(s.at("rest_before").at("contact"), true);
  EXPECT_EQ(s.at("rest_after").at("contact"), false);

  EXPECT_EQ(s.at("identified").at("feasible"), true);
  EXPECT_LT(s.at("identified").at("relative_error_percent"), 10.0);

  EXPECT_EQ(s.at("diagnosis").at("verdict"), "explained");
  ASSERT_EQ(s.at("diagnosis").at("effects").size(), 1u) << s.at("diagnosis").dump(2);
  const nlohmann::json effect = s.at("diagnosis").at("effects")[0];
  EXPECT_EQ(effect.at("name"), "payload");
  EXPECT_NEAR(effect.at("parameters").at("mass").at("value"), 1.8, 0.05 * 1.8);

  EXPECT_EQ(s.at("push").at("contact"), true);
  EXPECT_EQ(s.at("push").at("link"), "panda_link7") << "the contact test of the adopted model";
  EXPECT_LT(s.at("push").at("relative_error"), 0.1);  // of the vector: sign, joint and size
  if (!HasFailure()) std::filesystem::remove_all(folder);
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
