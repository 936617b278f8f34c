// SPDX-License-Identifier: Apache-2.0
// dynid diagnose --fleet: one model, many robots' logs.
#include "dynid/app/fleet.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "app/serialise.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "page_laws.hpp"
#include "small_problems.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

/// Of this test alone: ctest runs several at once.
std::string temporary(const std::string& name) {
  const std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  const fs::path path = fs::path(::testing::TempDir()) / ("dynid_fleet_" + test + "_" + name);
  fs::remove_all(path);
  return path.string();
}

/// Two robots, `sick` with friction that its model does not have, and one whose log is not there.
FleetJob job(std::atomic<int>& reads) {
  FleetJob out;
  out.members = {{"healthy", {"healthy.csv"}}, {"gone", {"gone.csv"}}, {"sick", {"sick.csv"}}};
  out.each = test::diagnose_job();
  const Log sick = out.each.logs.front();
  out.each.logs.clear();
  Log healthy = test::synthetic_log(out.each.nominal, 3, 12.0, 100.0, 0.02);
  out.read = [sick, healthy, &reads](const std::string& path) {
    ++reads;
    if (path == "gone.csv") throw Error(path + ": cannot be read: no such file");
    return path == "sick.csv" ? sick : healthy;
  };
  out.inputs = "the same model";
  return out;
}

const FleetReport& done() {
  static std::atomic<int> reads{0};
  static const FleetReport report = run(job(reads));
  return report;
}

std::string refusal(const std::string& text) {
  const std::string path = temporary("table.csv");
  write_file(path, text);
  try {
    read_fleet(path);
  } catch (const Error& error) {
    return std::string(error.what()).substr(path.size());
  }
  return "";
}

TEST(Fleet, TheTableIsRead) {
  const std::string path = temporary("table.csv"), folder = fs::path(path).parent_path().string();
  write_file(path,
             "\xef\xbb\xbf# cell 3\r\nlog;robot;log2\r\nruns/a 1.csv;A;\"b;2.csv\"\r\n\r\n/c.csv;B;\r\n");
  const std::vector<FleetMember> fleet = read_fleet(path);
  ASSERT_EQ(fleet.size(), 2U);
  EXPECT_EQ(fleet[0].robot, "A");
  EXPECT_EQ(fleet[0].logs, (std::vector<std::string>{(fs::path(folder) / "runs/a 1.csv").string(),
                                                     (fs::path(folder) / "b;2.csv").string()}));
  EXPECT_EQ(fleet[1].logs, std::vector<std::string>{"/c.csv"});
}

TEST(Fleet, TablesAreRefusedByLine) {
  EXPECT_EQ(refusal("robot,log\n"), ": no robot: a header robot,log and a row a robot are expected");
  EXPECT_EQ(refusal("robot,file\nA,a.csv\n"), ":1: column 'file': expected robot, log, log2, log3...");
  EXPECT_EQ(refusal("robot\nA\n"), ":1: the header has to name the columns robot and log");
  EXPECT_EQ(refusal("robot,log,log\nA,a,b\n"), ":1: the header names column log twice");
  EXPECT_EQ(refusal("robot,log\nA,a.csv\n,b.csv\n"), ":3: the row names no robot");
  EXPECT_EQ(refusal("robot,log\nA,\n"), ":2: robot A has no log");
  EXPECT_EQ(refusal("robot,log\nA,a.csv\nA,b.csv\n"), ":3: robot A is there twice");
  EXPECT_EQ(refusal("robot,log\nA,a.csv,b.csv\n"), ":2: the row has 3 fields, the header names 2");
}

TEST(Fleet, TheLargestGapIsFirstAndABadLogIsNamed) {
  const FleetReport& report = done();
  ASSERT_EQ(report.entries.size(), 3U);
  EXPECT_FALSE(report.succeeded());
  EXPECT_EQ(report.entries[0].member.robot, "sick");
  EXPECT_GT(report.entries[0].gap, 1.0);
  ASSERT_FALSE(report.entries[0].diagnosis.effects.empty());
  EXPECT_EQ(report.entries[0].diagnosis.effects[0].name, "viscous_friction");
  EXPECT_EQ(report.entries[1].member.robot, "healthy");
  EXPECT_LT(report.entries[1].gap, 1.0);
  EXPECT_EQ(report.entries[1].diagnosis.verdict, "no_gap");
  EXPECT_EQ(report.entries[2].member.robot, "gone");
  EXPECT_EQ(report.entries[2].error, "gone.csv: cannot be read: no such file");
  ASSERT_EQ(report.causes.size(), 2U);
  for (const FleetCause& cause : report.causes)
    EXPECT_EQ(cause.effects.empty(), cause.entries == std::vector<std::size_t>{1});
}

TEST(Fleet, BegunAgainItGoesOnWhereItWas) {
  std::atomic<int> reads{0};
  FleetJob first = job(reads);
  first.folder = temporary("kept");
  const std::vector<FleetMember> all = first.members;
  first.members = {all[0]};  // killed after one
  run(first);
  EXPECT_EQ(reads, 1);
  first.members = all;
  const FleetReport resumed = run(first);
  EXPECT_EQ(reads, 3);  // the healthy one is taken from the folder
  EXPECT_EQ(to_json(resumed).dump(), to_json(done()).dump());
  EXPECT_EQ(resumed.html("again", "1"), done().html("again", "1"));
  first.inputs = "another model";
  run(first);
  EXPECT_EQ(reads, 6);
  fs::remove_all(first.folder);
}

TEST(Fleet, RanksMakeNoDifference) {
  std::atomic<int> reads{0};
  FleetJob share = job(reads);
  share.ranks = 2;
  share.rank = 1;
  std::vector<std::string> of_the_other;
  struct Enough {};
  share.gather = [&](std::vector<std::string>& texts) {
    of_the_other = texts;
    throw Enough();
  };
  EXPECT_THROW(run(share), Enough);
  share.rank = 0;
  share.gather = [&](std::vector<std::string>& texts) {
    for (std::size_t k = 0; k < texts.size(); ++k) {
      EXPECT_NE(texts[k].empty(), of_the_other[k].empty()) << "each is made once";
      if (texts[k].empty()) texts[k] = of_the_other[k];
    }
  };
  EXPECT_EQ(to_json(run(share)).dump(), to_json(done()).dump());
  EXPECT_EQ(reads, 3);
}

TEST(Fleet, StopsWhenAsked) {
  std::atomic<int> reads{0};
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  EXPECT_THROW(run(job(reads), context), Stopped);
  EXPECT_EQ(reads, 0);
  EXPECT_THROW(run(FleetJob()), OptionError);
}

TEST(Fleet, ThePageAndTheTableSayIt) {
  const std::string page = done().html("dynid diagnose --fleet '<t>'", "1.2");
  test::PageLaws::check(page);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  for (const char* part :
       {"id=\"causes\"", "id=\"robots\"", "The largest gap is that of sick", "Viscous friction",
        "1 robot could not be diagnosed", "gone.csv: cannot be read", "&lt;t&gt;", "dynid 1.2"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  std::ostringstream out;
  print(out, done());
  EXPECT_NE(out.str().find("viscous friction"), std::string::npos);
  EXPECT_NE(out.str().find("not diagnosed: gone.csv"), std::string::npos);
}

}  // namespace
}  // namespace dynid
