// SPDX-License-Identifier: Apache-2.0
// The report: every section is there whatever the verdict, it is well-formed, it needs nothing from anywhere,
// and a browser shows it.
#include "dynid/app/report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <regex>
#include <string>

#include "app/page_plots.hpp"
#include "base/page.hpp"
#include "base/plot.hpp"
#include "dynid/base/file.hpp"
#include "page_laws.hpp"

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
    SCOPED_TRACE(to_string(verdict));
    test::PageLaws::check(page);
    for (const char* id : sections)
      EXPECT_EQ(count(page, std::string(" id=\"") + id + "\""), 1u) << id << ", " << to_string(verdict);
    EXPECT_LT(page.find("<h1"), page.find("<section")) << "the verdict comes first";
  }
}

// What of a set is too unsure to be named is said as such: it is no unknown effect.
TEST(Report, TheSentenceSaysWhatIsNotSure) {
  Diagnosis d = example(Verdict::partly_explained);
  EXPECT_NE(verdict_sentence(d).find("none of the known effects"), std::string::npos) << verdict_sentence(d);
  d.considered = {{"torque_gain", {2}, 0.6, {}, 0.42}, {"viscous_friction", {2}, 0.4, {}, 0.97}};
  d.judgement.push_back({"set_explains", 0.99, 0.65, true, "together"});
  EXPECT_NE(
      verdict_sentence(d).find("what causes the rest cannot be told; nearest comes torque gain at 0.42."),
      std::string::npos)
      << verdict_sentence(d);
}

// What is next to nothing of all of the gap is no cause of it.
TEST(Report, TheSentenceSaysWhatIsSmallAsSuch) {
  Diagnosis d = example(Verdict::explained);
  const std::string one = verdict_sentence(d);
  d.effects.push_back(d.effects.front());
  d.effects.back().effect.name = "torque_gain";
  d.effects.back().effect.joints = {2};
  d.effects.back().aliases.clear();
  d.effects.back().share = 0.002;
  EXPECT_EQ(verdict_sentence(d),
            one.substr(0, one.size() - 1) +
                "; torque gain on joint 2 is less than a hundredth of it, but much of one "
                "joint's own.");
  d.effects.back().share = 0.02;
  EXPECT_EQ(verdict_sentence(d).find("hundredth"), std::string::npos) << verdict_sentence(d);
}

// Where the gap does not shrink, it is not said to, and why not is.
TEST(Report, TheSentenceSaysWhatTheModelsErrorsHide) {
  Diagnosis d = example(Verdict::partly_explained);
  d.shrink.fraction = -0.1;
  d.nominal_error = 0.1;
  EXPECT_EQ(verdict_sentence(d).find("does not shrink"), std::string::npos)
      << "a contact that does not come back shrinks nothing either";
  d.judgement.push_back({"nominal_opposes", 0.1, 0.0, true, "against"});
  EXPECT_NE(verdict_sentence(d).find("does not shrink"), std::string::npos) << verdict_sentence(d);
  EXPECT_NE(verdict_sentence(d).find("parameters are off, about 10"), std::string::npos)
      << verdict_sentence(d);
}

TEST(Report, StandsAlone) {
  const std::string page = to_html(example(Verdict::explained), context());
  for (const char* part : {"<link", "<img", "<iframe", " src=", "url(", "@import", "href=\"http"})
    EXPECT_EQ(page.find(part), std::string::npos) << part;
  EXPECT_NE(
      page.find("content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'\""),
      std::string::npos)
      << "and a browser lets it load nothing";
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
  const bool live = has_page_template("uplot_script");
  const std::string page = to_html(example(Verdict::explained), context());
  EXPECT_EQ(count(page, "<svg"), gnuplot ? 8u : 0u) << "four joints over time, two replayed, each twice";
  EXPECT_EQ(count(page, "<figure"), live      ? 21u
                                    : gnuplot ? 8u
                                              : 0u)
      << "of the others too, shown when asked for";
  EXPECT_EQ(page.find("is not installed") == std::string::npos, gnuplot);

  const char* const path = std::getenv("PATH");
  const std::string old = path != nullptr ? path : "";
  setenv("PATH", "/nonexistent", 1);
  const std::string bare = to_html(example(Verdict::explained), context());
  setenv("PATH", old.c_str(), 1);
  EXPECT_EQ(bare.find("<svg"), std::string::npos);
  EXPECT_NE(bare.find("is not installed"), std::string::npos);
  EXPECT_EQ(count(bare, "<noscript>"), live ? 2u : 0u) << "said where it is so, without scripts";
  test::PageLaws::check(bare);
}

TEST(Report, HasTheDataOfItsPlotsOnce) {
  if (!has_page_template("uplot_script")) GTEST_SKIP() << "built without uPlot";
  const Diagnosis d = example(Verdict::explained);
  const std::string page = to_html(d, context());
  const std::string head = "<script type=\"application/json\" id=\"plot-data\">";
  ASSERT_EQ(count(page, head), 1u);
  const std::size_t begin = page.find(head) + head.size();
  const auto data = nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  ASSERT_EQ(data.at("groups").size(), 2u);
  const auto& gap = data["groups"][0];
  EXPECT_EQ(gap["plots"].size(), 7u);
  const auto column = [&](const nlohmann::json& group, std::size_t k) {
    Eigen::VectorXd x(static_cast<Eigen::Index>(group["columns"][k]["values"].size()));
    for (Eigen::Index i = 0; i < x.size(); ++i)
      x[i] = group["columns"][k]["values"][static_cast<std::size_t>(i)].get<double>() *
             group["columns"][k]["unit"].get<double>();
    return x;
  };
  const auto& line = gap["plots"][1]["lines"];
  EXPECT_LT((column(gap, line[0]["column"]) - d.series.before.col(1)).cwiseAbs().maxCoeff(), 5.1e-4);
  EXPECT_LT((column(gap, line[1]["column"]) - d.series.after.col(1)).cwiseAbs().maxCoeff(), 2.6e-5);
  EXPECT_NE(gap["plots"][1]["label"].get<std::string>().find("joint 2"), std::string::npos);
  const auto& replay = data["groups"][1];
  EXPECT_EQ(replay["plots"].size(), 14u);
  EXPECT_EQ(replay["columns"].size(), 21u) << "errors are made of positions";
}

// Law: within a pixel's width of every row there is one of the thinned at least as large, and one at least as
// small; none is beyond what the rows have; lines break where a stretch begins; the size is bounded.
TEST(Plots, ThinningKeepsThePeaksOfEveryPixel) {
  std::mt19937_64 random(7);
  for (const Eigen::Index size : {1, 2, 399, 400, 401, 5000, 100000}) {
    const Eigen::Index width = 200;
    const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(size, 0.0, double(size));
    Eigen::MatrixXd x(size, 3);
    std::vector<bool> fresh(static_cast<std::size_t>(size), false);
    for (Eigen::Index i = 0; i < size; ++i)
      for (Eigen::Index c = 0; c < 3; ++c) x(i, c) = std::normal_distribution<double>()(random);
    x(size / 2, 1) = 100.0;
    x(size / 3, 2) = -100.0;
    const std::size_t stretches = size > 1000 ? 4 : 1;
    for (std::size_t k = 1; k < stretches; ++k) fresh[k * static_cast<std::size_t>(size) / stretches] = true;
    const detail::PlotGroup few = detail::thinned(t, x, fresh, width);
    SCOPED_TRACE(size);
    ASSERT_LE(few.t.size(), 2 * width + 3 * Eigen::Index(stretches));
    ASSERT_EQ(few.t.size(), few.columns.rows());
    std::size_t breaks = 0;
    for (Eigen::Index i = 0; i < few.t.size(); ++i) {
      if (i > 0) {
        ASSERT_GE(few.t[i], few.t[i - 1]);
      }
      breaks += std::isnan(few.columns(i, 0)) ? 1 : 0;
      ASSERT_EQ(std::isnan(few.columns(i, 0)), std::isnan(few.columns(i, 2)));
    }
    EXPECT_EQ(breaks, stretches - 1);
    const double pixel = 2.0 * double(size) / double(width);
    for (Eigen::Index i = 0; i < size; i += 1 + size / 300)
      for (Eigen::Index c = 0; c < 3; ++c) {
        double low = 1e9, high = -1e9;
        for (Eigen::Index k = 0; k < few.t.size(); ++k)
          if (std::abs(few.t[k] - t[i]) <= pixel && !std::isnan(few.columns(k, c))) {
            low = std::min(low, few.columns(k, c));
            high = std::max(high, few.columns(k, c));
          }
        ASSERT_LE(low, x(i, c)) << i;
        ASSERT_GE(high, x(i, c)) << i;
      }
    for (Eigen::Index c = 0; c < 3; ++c)
      for (Eigen::Index k = 0; k < few.t.size(); ++k)
        if (!std::isnan(few.columns(k, c))) {
          ASSERT_LE(few.columns(k, c), x.col(c).maxCoeff());
          ASSERT_GE(few.columns(k, c), x.col(c).minCoeff());
        }
  }
}

TEST(Report, OfALongLogStaysSmall) {
  Diagnosis d = example(Verdict::explained);
  constexpr Eigen::Index N = 200000;
  std::mt19937_64 random(8);
  d.series.t = Eigen::VectorXd::LinSpaced(N, 0.0, 20000.0);
  d.series.before =
      Eigen::MatrixXd::NullaryExpr(N, 7, [&] { return std::normal_distribution<double>()(random); });
  d.series.after = 0.1 * d.series.before;
  d.series.log.assign(N, 0);
  d.series.held_out.assign(N, true);
  EXPECT_LT(to_html(d, context()).size(), 800000u);
}

// WCAG 2.1: text 4.5 to 1 at least, what a plot is read by 3 to 1, in both schemes.
TEST(Report, HasContrast) {
  const std::string style = detail::page_templates().at("style");
  const std::size_t dark_from = style.find("@media (prefers-color-scheme: dark)");
  ASSERT_NE(dark_from, std::string::npos);
  const auto linear = [](double x) { return x <= 0.03928 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); };
  using Colour = Eigen::Vector3d;
  const auto luminance = [&](const Colour& c) {
    return 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
  };
  const auto contrast = [&](const Colour& a, const Colour& b) {
    const double x = luminance(a), y = luminance(b);
    return (std::max(x, y) + 0.05) / (std::min(x, y) + 0.05);
  };
  for (const bool dark : {false, true}) {
    const std::string text =
        dark ? style.substr(dark_from, style.find("} }", dark_from) - dark_from) : style.substr(0, dark_from);
    std::map<std::string, Colour> of;
    const std::regex hex("--([a-z]+): #([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})"),
        rgb("--(heat): (\\d+) (\\d+) (\\d+)");
    for (const auto& [pattern, base] : {std::pair{hex, 16}, std::pair{rgb, 10}})
      for (std::sregex_iterator m(text.begin(), text.end(), pattern), end; m != end; ++m)
        of[m->str(1)] = Colour(std::stoi(m->str(2), nullptr, base), std::stoi(m->str(3), nullptr, base),
                               std::stoi(m->str(4), nullptr, base)) /
                        255.0;
    for (const char* ground : {"page", "card"}) {
      for (const char* ink : {"ink", "soft", "good", "warn", "bad", "accent"})
        EXPECT_GE(contrast(of.at(ink), of.at(ground)), 4.5)
            << ink << " on " << ground << (dark ? ", dark" : "");
      for (const char* line : {"before", "after", "floor"})
        EXPECT_GE(contrast(of.at(line), of.at(ground)), 3.0)
            << line << " on " << ground << (dark ? ", dark" : "");
    }
    for (const double shade : {0.0, 0.2, 0.5, 0.85}) {
      const Colour cell = shade * of.at("heat") + (1.0 - shade) * of.at("card");
      EXPECT_GE(contrast(of.at("ink"), cell), 4.5) << shade << (dark ? ", dark" : "");
    }
  }
}

/// The page in headless Chromium: what the script `probe` of it leaves in the document's title. Fails on
/// anything that the browser's console says.
std::string seen(std::string page, const std::string& probe, const std::string& width) {
  std::string folder = (std::filesystem::temp_directory_path() / "dynid-report-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return "no folder";
  page.replace(page.rfind("</body>"), 7, "<script>//<![CDATA[\n" + probe + "\n//]]></script></body>");
  write_file(folder + "/report.html", page);
  const std::string command =
      "timeout 100 chromium --headless --no-sandbox --disable-gpu --user-data-dir='" + folder +
      "/profile' --enable-logging=stderr --virtual-time-budget=10000 --window-size=" + width +
      ",900 --dump-dom 'file://" + folder + "/report.html' >'" + folder + "/dom' 2>'" + folder + "/log'";
  EXPECT_EQ(std::system(command.c_str()), 0) << read_file(folder + "/log");
  const std::string dom = read_file(folder + "/dom"), log = read_file(folder + "/log");
  EXPECT_EQ(log.find("CONSOLE"), std::string::npos) << log;
  const std::size_t at = dom.find("<title>") + 7;
  std::filesystem::remove_all(folder);
  return dom.substr(at, dom.find("</title>") - at);
}

bool has_browser() { return std::system("command -v chromium >/dev/null 2>&1") == 0; }

const char* const look = R"(addEventListener("load", function () {
  var out = { sections: [], drawings: 0, plots: 0 };
  document.querySelectorAll("header, section").forEach(function (s) {
    if (s.getBoundingClientRect().height > 20) out.sections.push(s.id); });
  document.querySelectorAll("svg").forEach(function (s) { if (s.getBoundingClientRect().height > 80) ++out.drawings; });
  document.querySelectorAll("figure canvas").forEach(function (c) {
    if (c.getBoundingClientRect().height < 80) return;
    // Something of the colours of the lines is on it.
    var d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data, coloured = 0;
    for (var i = 0; i < d.length; i += 4) if (d[i + 3] > 200 && Math.abs(d[i] - d[i + 2]) > 60) ++coloured;
    if (coloured > 100) ++out.plots;
  });
  out.beyond = document.documentElement.scrollWidth - innerWidth;
  document.title = JSON.stringify(out); });)";

TEST(Report, OpensInABrowser) {
  if (!has_browser()) GTEST_SKIP() << "chromium is not installed";
  const bool live = has_page_template("uplot_script");
  const std::string page = to_html(example(Verdict::explained), context());
  // As it is, and as a browser shows it that runs none of its scripts.
  std::string still = page;
  for (std::size_t at; (at = still.find("<script")) != std::string::npos;)
    still.erase(at, still.find("</script>", at) + 9 - at);
  for (const bool scripts : {true, false})
    for (const char* width : {"1200", "500"}) {
      const std::string title = seen(scripts ? page : still, look, width);
      ASSERT_EQ(title.substr(0, 1), "{") << title;
      const auto out = nlohmann::json::parse(title);
      for (const char* id : sections) {
        if (std::string(id) == "aliases") continue;  // a part of the effects
        EXPECT_EQ(std::count(out["sections"].begin(), out["sections"].end(), id), 1) << id << ": " << title;
      }
      EXPECT_EQ(out["plots"], scripts && live ? 8u : 0u) << title;
      EXPECT_EQ(out["drawings"], scripts && live ? 0u : count(page, "<svg")) << title;
      EXPECT_LE(out["beyond"], 0) << "the page is wider than a window of " << width;
    }
}

TEST(Report, JointsGoOnAndOffAndCursorsAndZoomGoTogether) {
  if (!has_browser()) GTEST_SKIP() << "chromium is not installed";
  if (!has_page_template("uplot_script")) GTEST_SKIP() << "built without uPlot";
  const std::string title = seen(to_html(example(Verdict::explained), context()), R"(
addEventListener("load", async function () {
  var out = {}, wait = function () { return new Promise(function (f) { setTimeout(f, 20); }); };
  var folder = document.querySelector('.plots[data-group="residual"]'), section = folder.parentNode;
  function shown() { return folder.querySelectorAll("figure:not([hidden]) canvas").length; }
  function frames() { return Array.from(folder.querySelectorAll("figure:not([hidden]) .plot")); }
  function ranges() { return frames().map(function (f) { return [f.plot.scales.x.min, f.plot.scales.x.max]; }); }
  function key(name) { frames()[0].dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true })); }
  function readouts() { return frames().map(function (f) { return f.parentNode.querySelector(".readout").textContent; }); }
  var boxes = Array.from(section.querySelectorAll("input[type=checkbox]"));
  out.boxes = boxes.map(function (b) { return b.checked; });
  out.named = boxes.map(function (b) { return b.labels[0].textContent; });
  var off = boxes.find(function (b) { return !b.checked; });
  out.first = shown(); off.click(); await wait(); out.more = shown(); off.click(); await wait(); out.again = shown();
  frames()[0].focus(); out.focus = document.activeElement === frames()[0];
  key("+"); await wait(); out.zoomed = ranges();
  off.click(); await wait(); out.late = ranges(); off.click();
  key("ArrowRight"); await wait(); out.read = readouts();
  key("0"); await wait(); out.whole = ranges();
  var u = frames()[1].plot, box = u.over.getBoundingClientRect();
  function mouse(type, part, target) { target.dispatchEvent(new MouseEvent(type, { bubbles: true, button: 0, buttons: 1,
    movementX: 1, movementY: 1, clientX: box.left + part * box.width, clientY: box.top + 50 })); }
  mouse("mousemove", 0.25, u.over); mouse("mousedown", 0.25, u.over); mouse("mousemove", 0.5, u.over);
  mouse("mousemove", 0.75, u.over); mouse("mouseup", 0.75, document);
  await wait(); out.dragged = ranges();
  section.querySelector("button").click(); await wait(); out.reset = ranges();
  document.title = JSON.stringify(out); });)",
                                 "1200");
  ASSERT_EQ(title.substr(0, 1), "{") << title;
  const auto out = nlohmann::json::parse(title);
  EXPECT_EQ(out["boxes"].size(), 7u);
  EXPECT_EQ(std::count(out["boxes"].begin(), out["boxes"].end(), true), 4);
  EXPECT_EQ(out["named"][6], "7");
  EXPECT_EQ(out["first"], 4);
  EXPECT_EQ(out["more"], 5);
  EXPECT_EQ(out["again"], 4);
  EXPECT_EQ(out["focus"], true);
  const auto all_are = [&](const char* what, std::size_t count, double from, double to) {
    ASSERT_EQ(out[what].size(), count) << what;
    for (const auto& range : out[what]) {
      EXPECT_NEAR(range[0].get<double>(), from, 0.05) << what;
      EXPECT_NEAR(range[1].get<double>(), to, 0.05) << what;
    }
  };
  all_are("zoomed", 4, 1.5, 4.5);
  all_are("late", 5, 1.5, 4.5);
  all_are("whole", 4, 0.0, 6.0);
  all_are("dragged", 4, 1.5, 4.5);
  all_are("reset", 4, 0.0, 6.0);
  for (const auto& text : out["read"]) {
    EXPECT_EQ(text.get<std::string>().rfind("t 3.0", 0), 0u) << text;
    EXPECT_NE(text.get<std::string>().find("nominal model"), std::string::npos) << text;
  }
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
  for (const char* part : {"--assume torque_sign=-1", "turned &lt;all&gt;", "<th scope=\"row\">7</th>",
                           "What could not be seen", "Joint 3 never turns back &lt;here&gt;"})
    EXPECT_NE(html.find(part, panel), std::string::npos) << part;
  EXPECT_LT(panel, html.find("id=\"effects\""));
}

}  // namespace
}  // namespace dynid
