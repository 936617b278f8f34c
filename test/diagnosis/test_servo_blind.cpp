// SPDX-License-Identifier: Apache-2.0
//
// The bank of servo logs: the same for a seed whatever the threads, labels apart from logs, and worth the
// name: most of what is hidden in it is found.
#include "dynid/diagnosis/servo_blind.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <filesystem>

#include "dynid/base/error.hpp"
#include "simulation/robots.hpp"

namespace dynid {
namespace {

BlindOptions bank(const std::string& name, int cases) {
  BlindOptions options;
  options.cases = cases;
  options.seed = 11;
  options.family = true;
  options.folder = (std::filesystem::path(::testing::TempDir()) / ("dynid_servo_blind_" + name)).string();
  std::filesystem::remove_all(options.folder);
  return options;
}

TEST(ServoBlind, IsTheSameOnOneThread) {
  const BlindOptions options = bank("threads", 3);
  const std::vector<BlindCase> several = run_servo_blind(test::panda(), options);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const std::vector<BlindCase> alone = run_servo_blind(test::panda(), options);
  ASSERT_EQ(several.size(), 3U);
  for (std::size_t k = 0; k < several.size(); ++k) {
    EXPECT_EQ(several[k].failure, "");
    EXPECT_EQ(several[k].p_value, alone[k].p_value);
    EXPECT_EQ(several[k].shrink, alone[k].shrink);
    ASSERT_EQ(several[k].found.size(), alone[k].found.size());
    for (std::size_t e = 0; e < alone[k].found.size(); ++e)
      EXPECT_EQ(several[k].found[e].effect.parameters, alone[k].found[e].effect.parameters);
    ASSERT_EQ(several[k].truth.size(), alone[k].truth.size());
  }
  std::filesystem::remove_all(options.folder);
}

TEST(ServoBlind, KeepsLabelsApartAndFindsMost) {
  const BlindOptions options = bank("found", 8);
  const std::vector<BlindCase> cases = run_servo_blind(test::panda(), options);
  const std::filesystem::path folder = options.folder;
  for (const auto& file : std::filesystem::recursive_directory_iterator(folder / "logs"))
    EXPECT_TRUE(file.is_directory() || file.path().extension() == ".csv" ||
                file.path().extension() == ".yaml")
        << file.path();
  EXPECT_TRUE(std::filesystem::exists(folder / "sealed" / "case_00000.json"));
  const BlindScore s = score(cases);
  EXPECT_EQ(s.failures, 0);
  EXPECT_EQ(s.no_gap + s.known + s.unknown, 8);
  EXPECT_GE(2 * s.first_right, s.known);
  EXPECT_EQ(s.healthy_confident, 0);
  std::filesystem::remove_all(options.folder);
}

TEST(ServoBlind, KnowsNoVendor) {
  BlindOptions options = bank("vendor", 1);
  options.kind = BlindKind::vendor;
  EXPECT_THROW(run_servo_blind(test::panda(), options), Error);
}

}  // namespace
}  // namespace dynid
