// SPDX-License-Identifier: Apache-2.0
// The report: every section is there whatever the verdict, it is well-formed, it needs nothing from anywhere,
// and a browser shows it.
#include "dynid/app/report.hpp"

#include <expat.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/plot.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

const char* const sections[] = {"verdict", "answerable", "effects", "aliases", "where", "residual",
                                "shrink",  "replay",     "ranking", "data",    "next",  "reproduce"};

/// Seven joints, a gap on the second, with names that want to be markup.
Diagnosis example(Verdict verdict) {
  constexpr int n = 7, N = 120;
  Diagnosis d;
  d.verdict = verdict;
  d.p_value = 0.005;
  d.rms = Eigen::VectorXd::Constant(n, 0.1);
  d.rms[1] = 2.0;
  d.floor = Eigen::VectorXd::Constant(n, 0.05);
  for (int j = 1; j <= n; ++j)
    for (const char* regime : {"low speed", "high speed", "forward", "low load", "first third"})
      d.where.push_back({j, regime, j == 2 ? 0.4 : 0.01, j == 2 ? 0.01 : 0.6});
  d.windows.push_back({"a/<log>&1.csv", 2.0, 3.0, {2}});
  if (verdict == Verdict::explained || verdict == Verdict::partly_explained) {
    FoundEffect e;
    e.effect.name = "viscous_friction";
    e.effect.joints = {2};
    e.share = 1.0;
    e.probability = 0.97;
    e.aliases = {"thermal_friction_drift"};
    Eigen::VectorXd value = Eigen::VectorXd::Zero(n);
    value[1] = 1.25;
    e.parameters.push_back({"coefficient", "N m s/rad", value, 0.9 * value, 1.1 * value, true});
    d.effects.push_back(e);
    d.next.text = "Run slowly & again.";
    d.next.separates = {{"viscous_friction", "thermal_friction_drift"}};
  }
  d.ranking = {{"viscous_friction", 0.9}, {"payload", 0.05}, {"backlash", 0.0}};
  d.shrink = {d.rms, d.floor, d.floor, 0.96, 0.93, 0.98, true};
  d.series.t = Eigen::VectorXd::LinSpaced(N, 0.0, 6.0);
  d.series.before = Eigen::MatrixXd::Constant(N, n, 0.05);
  d.series.before.col(1) = (3.0 * d.series.t).array().sin();
  d.series.after = 0.05 * d.series.before;
  d.series.log.assign(N, 0);
  for (int i = 0; i < N; ++i) d.series.held_out.push_back(static_cast<int>(d.series.t[i]) % 2 == 1);
  d.rollout.horizon = Eigen::Vector3d(0.1, 0.5, 1.0);
  d.rollout.before = Eigen::Vector3d(0.01, 0.1, 1.5);
  d.rollout.after = Eigen::Vector3d(0.001, 0.01, 0.02);
  d.rollout.t = d.series.t;
  d.rollout.start = (d.series.t.array() / 1.5).cast<int>();
  d.rollout.q = d.rollout.with = d.rollout.without = d.series.before;
  d.rollout.without.col(1).array() += 0.1;
  d.logs.resize(1);
  d.logs[0].report.samples = 1500;
  d.logs[0].report.rate_hz = 250.0;
  d.logs[0].report.issues.push_back({"velocity_lag", {1, 2}, 0.005, "s", "dq lags <q> by 5 ms & was mended"});
  return d;
}

ReportContext context() {
  return {"a <b>robot</b> & \"more\"",
          {"folder/<log>&1.csv"},
          "dynid diagnose --log '<log>&1.csv'",
          "1.2",
          false};
}

std::string ill_formed(const std::string& page) {
  XML_Parser parser = XML_ParserCreate(nullptr);
  std::string error;
  if (XML_Parse(parser, page.data(), static_cast<int>(page.size()), XML_TRUE) != XML_STATUS_OK)
    error = std::string(XML_ErrorString(XML_GetErrorCode(parser))) + " in line " +
            std::to_string(XML_GetCurrentLineNumber(parser));
  XML_ParserFree(parser);
  return error;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++n;
  return n;
}

const Verdict verdicts[] = {Verdict::no_gap,           Verdict::not_detected, Verdict::explained,
                            Verdict::partly_explained, Verdict::unexplained,  Verdict::misread,
                            Verdict::data_invalid};

TEST(Report, IsWellFormedWithEverySectionOnceWhateverTheVerdict) {
  for (const Verdict verdict : verdicts) {
    const std::string page = to_html(example(verdict), context());
    EXPECT_EQ(ill_formed(page), "") << to_string(verdict);
    for (const char* id : sections)
      EXPECT_EQ(count(page, std::string(" id=\"") + id + "\""), 1u) << id << ", " << to_string(verdict);
    EXPECT_LT(page.find("<h1"), page.find("<section")) << "the verdict comes first";
  }
}

TEST(Report, StandsAlone) {
  const std::string page = to_html(example(Verdict::explained), context());
  for (const char* part : {"<script", "<link", "<img", "src=", "url(", "@import", "href=\"http"})
    EXPECT_EQ(page.find(part), std::string::npos) << part;
  for (const char* name : {"<b>robot", "<log>"}) EXPECT_EQ(page.find(name), std::string::npos) << name;
  EXPECT_NE(page.find("prefers-color-scheme: dark"), std::string::npos);
}

TEST(Report, SaysWhatWasFound) {
  const std::string page = to_html(example(Verdict::explained), context());
  for (const char* part : {"Viscous friction on joint 2", "thermal friction drift", "1.25", "96",
                           "velocity lag", "Run slowly &amp; again.", "dynid diagnose --log"})
    EXPECT_TRUE(page.find(part) != std::string::npos ||
                page.find(std::string(1, char(std::toupper(part[0]))) + (part + 1)) != std::string::npos)
        << part;
}

TEST(Report, EverySentenceIsOne) {
  for (const Verdict verdict : verdicts) {
    const std::string sentence = verdict_sentence(example(verdict));
    EXPECT_EQ(sentence.back(), '.') << sentence;
    EXPECT_EQ(count(sentence, ". "), 0u) << sentence;
  }
}

TEST(Report, PlotsAreThereOrSaidToBeMissing) {
  const bool gnuplot = !plot_svg("set terminal svg\nplot x\n", "probe").empty();
  const std::string page = to_html(example(Verdict::explained), context());
  EXPECT_EQ(count(page, "<svg") > 0, gnuplot);
  EXPECT_EQ(page.find("gnuplot is not installed") == std::string::npos, gnuplot);
  if (gnuplot) {
    EXPECT_GE(count(page, "<figure>"), 6u) << "four joints over time, two replayed";
  }

  const char* const path = std::getenv("PATH");
  const std::string old = path != nullptr ? path : "";
  setenv("PATH", "/nonexistent", 1);
  const std::string bare = to_html(example(Verdict::explained), context());
  setenv("PATH", old.c_str(), 1);
  EXPECT_EQ(bare.find("<svg"), std::string::npos);
  EXPECT_NE(bare.find("gnuplot is not installed"), std::string::npos);
  EXPECT_EQ(ill_formed(bare), "");
}

TEST(Report, OpensInABrowser) {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
  std::string folder = (std::filesystem::temp_directory_path() / "dynid-report-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  // A copy says of itself what the browser made of it.
  const std::string probe = R"(<script>addEventListener("load", function () {
    var out = [];
    document.querySelectorAll("header, section").forEach(function (s) {
      if (s.getBoundingClientRect().height > 20) out.push(s.id); });
    document.querySelectorAll("svg").forEach(function (s) {
      if (s.getBoundingClientRect().height > 80) out.push("plot"); });
    document.title = "shown:" + out.join(",") + ";beyond:" +
      (document.documentElement.scrollWidth - innerWidth) + ";"; });</script></body>)";
  std::string page = to_html(example(Verdict::explained), context());
  page.replace(page.find("</body>"), 7, probe);
  write_file(folder + "/report.html", page);
  for (const char* width : {"1200", "500"}) {
    const std::string command =
        "timeout 60 chromium --headless --no-sandbox --disable-gpu --user-data-dir='" + folder +
        "/profile' --enable-logging=stderr --window-size=" + width + ",900 --dump-dom 'file://" + folder +
        "/report.html' >'" + folder + "/dom' 2>'" + folder + "/log'";
    ASSERT_EQ(std::system(command.c_str()), 0) << read_file(folder + "/log");
    const std::string dom = read_file(folder + "/dom"), log = read_file(folder + "/log");
    EXPECT_EQ(log.find("CONSOLE"), std::string::npos) << log;
    const std::size_t at = dom.find("shown:");
    ASSERT_NE(at, std::string::npos) << dom.substr(0, 300);
    const std::string shown = dom.substr(at, dom.find(';', at) - at) + ",";
    for (const char* id : sections) {
      if (std::string(id) == "aliases") continue;  // a part of the effects
      EXPECT_NE(shown.find(id), std::string::npos) << id << ": " << shown;
    }
    EXPECT_EQ(count(shown, "plot,"), count(page, "<svg")) << shown;
    const int beyond = std::stoi(dom.substr(dom.find("beyond:", at) + 7));
    EXPECT_LE(beyond, 0) << "the page is wider than a window of " << width;
  }
  std::filesystem::remove_all(folder);
}

// The first panel says what was recorded, what could not be seen on it, and how it has to be read.
TEST(Report, BeginsWithWhatTheLogCanAnswer) {
  Diagnosis d = example(Verdict::misread);
  d.answerable.duration = 20.0;
  d.answerable.joints.assign(7, JointExcitation{});
  d.answerable.blind = {{"no_reversal", {3}, "joint 3 never turns back <here>"}};
  const ReportContext context{"panda", {"a.csv"}, "the command", "1", false};
  EXPECT_EQ(to_html(d, context).find("<pre>--assume"), std::string::npos);
  d.conventions.assume = "torque_sign=-1";
  d.conventions.conventions = {{"torque_sign", {}, -1.0, -2.0, 0.97, "torque_sign=-1", "turned <all>"}};
  const std::string html = to_html(d, context);
  const auto panel = html.find("Can this log answer?");
  ASSERT_NE(panel, std::string::npos);
  for (const char* part : {"--assume torque_sign=-1", "turned &lt;all&gt;", "<td>7</td>",
                           "What could not be seen", "Joint 3 never turns back &lt;here&gt;"})
    EXPECT_NE(html.find(part, panel), std::string::npos) << part;
  EXPECT_LT(panel, html.find("id=\"effects\""));
}

}  // namespace
}  // namespace dynid
