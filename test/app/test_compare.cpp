// SPDX-License-Identifier: Apache-2.0
// dynid compare: two or more diagnoses side by side.
#include "dynid/app/compare.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "app/serialise.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/text.hpp"
#include "page_laws.hpp"

namespace dynid {
namespace {

FoundEffect effect(const std::string& name, std::vector<int> joints, double value, double half_width) {
  FoundEffect e;
  e.effect.name = name;
  e.effect.joints = std::move(joints);
  e.share = 0.9;
  e.probability = 0.8;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(4), width = x;
  for (const int j : e.effect.joints) x[j - 1] = value, width[j - 1] = half_width;
  e.parameters.push_back({"coefficient", "N m", x, x - width, x + width, true});
  return e;
}

/// Four joints with a gap of `gap` on the second.
DiagnoseReport diagnosis(Verdict verdict, double gap, std::vector<FoundEffect> effects = {}) {
  DiagnoseReport report;
  Diagnosis& d = report.diagnosis;
  d.verdict = verdict;
  d.rms = Eigen::VectorXd::Constant(4, 0.05);
  d.rms[1] = gap;
  d.floor = Eigen::VectorXd::Constant(4, 0.04);
  d.upper = d.tolerance = d.rms;
  d.unit.assign(4, "N m");
  d.logs.resize(1);
  d.effects = std::move(effects);
  d.shrink = {d.rms, d.floor, d.floor, 0.96, 0.93, 0.98, true};
  return report;
}

/// As the program writes it.
CompareJob::Entry entry(const std::string& name, const DiagnoseReport& report) {
  return {name, to_json(report).dump()};
}

std::vector<Change::Kind> kinds(const CompareReport& report) {
  std::vector<Change::Kind> all;
  for (const Change& change : report.changes) all.push_back(change.kind);
  return all;
}

std::string printed(const CompareReport& report) {
  std::ostringstream out;
  print(out, report);
  return out.str();
}

TEST(Compare, TheSameIsNoChange) {
  const auto one =
      entry("a.json", diagnosis(Verdict::explained, 1.0, {effect("coulomb_friction", {2}, 0.9, 0.1)}));
  const CompareReport report = run(CompareJob{{one, one, one}});
  EXPECT_TRUE(report.changes.empty());
  ASSERT_EQ(report.effects.size(), 1U);
  EXPECT_TRUE(report.effects[0].in[2].has_value());
  EXPECT_NE(printed(report).find("Nothing is different."), std::string::npos);
}

TEST(Compare, ARepairIsSeen) {
  const CompareReport report = run(CompareJob{
      {entry("before.json", diagnosis(Verdict::explained, 1.0, {effect("coulomb_friction", {2}, 0.9, 0.1)})),
       entry("after.json", diagnosis(Verdict::no_gap, 0.05))}});
  using Kind = Change::Kind;
  EXPECT_EQ(kinds(report), (std::vector<Kind>{Kind::verdict, Kind::gone, Kind::gap}));
  EXPECT_EQ(report.changes[2].text, "gap of joint 2: 1 -> 0.05 N m rms");
  EXPECT_EQ(report.changes[1].text, "gone: coulomb friction on joint 2");
  EXPECT_TRUE(report.diagnoses[0].shrink.has_value());
  EXPECT_FALSE(report.diagnoses[1].shrink.has_value());
  EXPECT_NE(printed(report).find("From before.json to after.json:"), std::string::npos);
}

/// Law: what is compared the other way round appears where it went.
TEST(Compare, ToAndFroAreOpposite) {
  const auto a = entry("a", diagnosis(Verdict::explained, 1.0, {effect("joint_spring", {1, 3}, 2.0, 0.1)})),
             b = entry("b", diagnosis(Verdict::unexplained, 3.0));
  const CompareReport to = run(CompareJob{{a, b}}), fro = run(CompareJob{{b, a}});
  EXPECT_EQ(to.changes[1].text, "gone: joint spring on joints 1 and 3");
  EXPECT_EQ(fro.changes[1].text, "new: joint spring on joints 1 and 3");
  EXPECT_EQ(to.changes.size(), fro.changes.size());
}

/// A number has changed where the intervals lie apart, and not before.
TEST(Compare, IntervalsDecideWhetherANumberHasChanged) {
  const auto with = [](double value, double half_width) {
    return entry("x",
                 diagnosis(Verdict::explained, 1.0, {effect("coulomb_friction", {2}, value, half_width)}));
  };
  EXPECT_TRUE(run(CompareJob{{with(0.9, 0.1), with(1.09, 0.1)}}).changes.empty());
  const CompareReport apart = run(CompareJob{{with(0.9, 0.1), with(1.11, 0.1)}});
  ASSERT_EQ(kinds(apart), std::vector<Change::Kind>{Change::Kind::changed});
  EXPECT_EQ(apart.changes[0].text, "coulomb friction on joint 2: coefficient of joint 2 0.9 -> 1.11 N m");
}

/// Two effects of one name are told apart by their joints; one that has moved is one that has changed.
TEST(Compare, EffectsOfOneNameAreMatchedByJoints) {
  const auto a = entry("a", diagnosis(Verdict::explained, 1.0,
                                      {effect("joint_spring", {1}, 2.0, 0.1),
                                       effect("joint_spring", {2}, 5.0, 0.1)})),
             b = entry("b", diagnosis(Verdict::explained, 1.0,
                                      {effect("joint_spring", {2}, 5.0, 0.1),
                                       effect("joint_spring", {4}, 2.0, 0.1)}));
  const CompareReport report = run(CompareJob{{a, b}});
  ASSERT_EQ(report.effects.size(), 2U);
  ASSERT_EQ(kinds(report), std::vector<Change::Kind>{Change::Kind::changed});
  EXPECT_EQ(report.changes[0].text, "joint spring: on joint 4, was on joint 1");
}

/// A log that could not be judged has no figures, and stands beside the others all the same.
TEST(Compare, AMisreadLogStandsBesideTheOthers) {
  DiagnoseReport misread;
  misread.diagnosis.verdict = Verdict::misread;
  misread.diagnosis.logs.resize(1);
  const CompareReport report =
      run(CompareJob{{entry("a", misread), entry("b", diagnosis(Verdict::no_gap, 0.05))}});
  EXPECT_EQ(kinds(report), std::vector<Change::Kind>{Change::Kind::verdict});
  EXPECT_NE(report.html("c", "1").find("Misread"), std::string::npos);
}

std::string refused(const CompareJob& job) {
  try {
    run(job);
  } catch (const Error& error) {
    return error.what();
  }
  return "not refused";
}

TEST(Compare, RefusesByName) {
  const auto good = entry("good.json", diagnosis(Verdict::no_gap, 0.05));
  DiagnoseReport other = diagnosis(Verdict::no_gap, 0.05), sliding = other;
  other.diagnosis.rms.conservativeResize(3);
  other.diagnosis.floor.conservativeResize(3);
  other.diagnosis.unit.resize(3);
  sliding.diagnosis.unit[1] = "N";
  EXPECT_THROW(run(CompareJob{{good}}), OptionError);
  EXPECT_EQ(refused(CompareJob{{good, entry("other.json", other)}}),
            "other.json: 3 joints, good.json has 4: only robots of one type can be compared");
  EXPECT_NE(
      refused(CompareJob{{good, entry("sliding.json", sliding)}}).find("sliding.json: joints of other types"),
      std::string::npos);
  EXPECT_NE(refused(CompareJob{{good, {"bad.json", "{\"format\": "}}})
                .find("bad.json: expected what dynid diagnose"),
            std::string::npos);
  for (const char* text :
       {"[]", "{}", "{\"format\": 3}", "{\"format\": \"dynid-blind-1\"}",
        "{\"format\": \"dynid-diagnosis-1\"}",
        "{\"format\": \"dynid-diagnosis-1\", \"verdict\": \"no_gap\", \"gap\": {\"rms\": [1], "
        "\"floor\": [], \"unit\": []}, \"effects\": []}"})
    EXPECT_EQ(refused(CompareJob{{good, {"bad.json", text}}}).rfind("bad.json: ", 0), 0U) << text;
}

/// The page is well-formed whatever the files are called, needs nothing else, and says what is in the report.
TEST(Compare, ThePageStandsByItself) {
  const std::string name = "a/<log>&\"1\".json";
  const CompareReport report = run(CompareJob{
      {entry(name, diagnosis(Verdict::explained, 1.0, {effect("coulomb_friction", {2}, 0.9, 0.1)})),
       entry("after.json", diagnosis(Verdict::no_gap, 0.05))}});
  const std::string page = report.html("dynid compare '<a>' b", "1.2");
  test::PageLaws::check(page);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("src="), std::string::npos);
  EXPECT_EQ(page.find("<log>"), std::string::npos);
  for (const char* part :
       {"id=\"changes\"", "id=\"gap\"", "id=\"effects\"", "Gone: coulomb friction on joint 2",
        "&lt;log&gt;&amp;", "dynid compare '&lt;a&gt;' b", "dynid 1.2", "coefficient 0.9 N m"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
}

TEST(Compare, JsonSaysTheSame) {
  const CompareReport report = run(
      CompareJob{{entry("a", diagnosis(Verdict::explained, 1.0, {effect("coulomb_friction", {2}, 0.9, 0.1)})),
                  entry("b", diagnosis(Verdict::no_gap, 0.05))}});
  const nlohmann::json json = to_json(report);
  EXPECT_EQ(json.at("format"), "dynid-comparison-1");
  EXPECT_EQ(json.at("diagnoses").at(1).at("verdict"), "no_gap");
  EXPECT_TRUE(json.at("effects").at(0).at("in").at(1).is_null());
  EXPECT_EQ(json.at("effects").at(0).at("in").at(0).at("parameters").at("coefficient").at("value").at(1),
            0.9);
  EXPECT_EQ(json.at("changes").size(), report.changes.size());
}

}  // namespace
}  // namespace dynid
