// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <sstream>

#include "base/plot.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "report_answerable.hpp"

namespace dynid {
namespace {

constexpr std::size_t most_plots = 4;
constexpr double gap_in_time = 0.2;   // [s]: a line is not drawn across
constexpr double replay_shown = 6.0;  // [s]

// Colours as gnuplot is told them, and the custom property of the page that each becomes.
struct Role {
  const char *colour, *property;
  int last;
};
constexpr Role roles[] = {{"#000001", "--rule", 1},   {"#000002", "--grid", 2},  {"#000003", "--soft", 3},
                          {"#000004", "--before", 4}, {"#000005", "--after", 5}, {"#000006", "--floor", 6},
                          {"#000007", "--ink", 7}};
constexpr const char *rule = roles[0].colour, *grid = roles[1].colour, *soft = roles[2].colour,
                     *before_colour = roles[3].colour, *after_colour = roles[4].colour,
                     *floor_colour = roles[5].colour, *ink = roles[6].colour;

constexpr char style[] = R"(
:root { color-scheme: light dark; --page: #f5f7f9; --card: #ffffff; --ink: #17212b; --soft: #5b6b7b; --rule: #c9d2db;
  --grid: #e6ebf0; --before: #c2631c; --after: #0b6fa4; --floor: #8a97a6; --good: #1d7a46; --warn: #a86400; --bad: #b3261e;
  --heat: 194 99 28; --accent: #0b6fa4; }
@media (prefers-color-scheme: dark) { :root { --page: #10161c; --card: #18212a; --ink: #e8eef4; --soft: #9aabbc;
  --rule: #3a4855; --grid: #26323d; --before: #f0975a; --after: #5cb8e6; --floor: #7d8b99; --good: #5fce90; --warn: #f0b445;
  --bad: #ff8a80; --heat: 240 151 90; --accent: #5cb8e6; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif;
  -webkit-text-size-adjust: 100%; }
main { max-width: 64rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
header { padding: 1rem 0 .5rem; }
.kicker { color: var(--soft); font-size: .85rem; margin: 0 0 .6rem; overflow-wrap: anywhere; }
h1 { font-size: clamp(1.45rem, 1rem + 2.4vw, 2.3rem); line-height: 1.22; letter-spacing: -.015em; margin: .6rem 0 1.2rem; font-weight: 650;
  text-wrap: balance; }
h1.long { font-size: clamp(1.2rem, 1rem + 1.2vw, 1.65rem); line-height: 1.3; max-width: 52rem; }
h2 { font-size: 1.2rem; margin: 0 0 .3rem; letter-spacing: -.005em; } h3 { font-size: 1.02rem; margin: 0 0 .2rem; }
p { margin: 0 0 .8rem; max-width: 46rem; } .note { color: var(--soft); font-size: .9rem; }
.badge { display: inline-block; border-radius: 99px; padding: .15rem .8rem; font-size: .85rem; font-weight: 600; color: var(--tone);
  border: 1.5px solid var(--tone); }
.good { --tone: var(--good); } .warn { --tone: var(--warn); } .bad { --tone: var(--bad); } .calm { --tone: var(--soft); }
section { background: var(--card); border: 1px solid var(--grid); border-radius: 14px; padding: 1.2rem 1.25rem; margin: 1rem 0; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .75rem; margin: 0 0 1.2rem; }
.figure { background: var(--card); border: 1px solid var(--grid); border-radius: 14px; padding: .8rem 1rem; }
.figure b { display: block; font-size: 1.45rem; line-height: 1.2; font-weight: 650; font-variant-numeric: tabular-nums; }
.figure span { color: var(--soft); font-size: .85rem; display: block; line-height: 1.35; }
.scroll { overflow-x: auto; margin: .5rem -.25rem; padding: 0 .25rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: .92rem; }
th, td { padding: .38rem .55rem; text-align: right; border-bottom: 1px solid var(--grid); white-space: nowrap; }
th { color: var(--soft); font-weight: 600; font-size: .82rem; } th:first-child, td:first-child { text-align: left; } td { vertical-align: baseline; }
thead th { white-space: normal; vertical-align: bottom; }
tr:last-child td { border-bottom: 0; }
table.fit { width: auto; min-width: min(100%, 22rem); } td small { color: var(--soft); margin-left: .6rem; font-size: .8rem; }
.heat { max-width: 46rem; } .heat td { text-align: center; padding: .3rem .2rem; border: 2px solid var(--card); border-radius: 6px; min-width: 2.2rem; }
.heat th { text-align: center; padding: .3rem .2rem; border: 0; } .heat tbody th { text-align: left; font-weight: 400; color: var(--ink);
  font-size: .86rem; padding-right: .6rem; }
.heat th.group { color: var(--soft); font-weight: 600; padding-top: .8rem; font-size: .78rem; }
.heat td.cell { background: rgb(var(--heat) / var(--a)); } .heat td.sure { font-weight: 700; box-shadow: inset 0 0 0 1.5px rgb(var(--heat)); }
.heat td.none { color: var(--rule); }
.bar { display: grid; grid-template-columns: minmax(8.5rem, 14rem) 1fr 3.2rem; gap: .7rem; align-items: center; margin: .3rem 0; font-size: .92rem; }
.bar i { display: block; height: .7rem; border-radius: 99px; background: var(--grid); overflow: hidden; }
.bar i u { display: block; height: 100%; border-radius: 99px; background: var(--accent); width: var(--w); }
.bar span:last-child { text-align: right; font-variant-numeric: tabular-nums; }
.bar.rest { color: var(--soft); } .bar.rest u { background: var(--floor); }
.span { position: relative; height: .9rem; min-width: 8rem; background: var(--grid); border-radius: 99px; }
.span u { position: absolute; top: .3rem; height: .3rem; background: var(--after); opacity: .45; border-radius: 99px; left: var(--l); width: var(--w); }
.span b { position: absolute; top: .1rem; width: .7rem; height: .7rem; margin-left: -.35rem; border-radius: 50%; background: var(--after); left: var(--x); }
.effect { border-top: 1px solid var(--grid); padding-top: .9rem; margin-top: .9rem; } .effect:first-of-type { border-top: 0; padding-top: 0; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 25rem), 1fr)); gap: .75rem 1.25rem; }
figure { margin: 0; } figcaption { font-size: .9rem; font-weight: 600; } svg { display: block; width: 100%; height: auto; }
.legend { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; font-size: .88rem; color: var(--soft); margin: .3rem 0 .7rem; padding: 0; list-style: none; }
.legend i { display: inline-block; width: 1.3rem; height: .22rem; border-radius: 9px; vertical-align: middle; margin-right: .45rem; }
pre { background: var(--page); border: 1px solid var(--grid); border-radius: 10px; padding: .8rem 1rem; overflow-x: auto; font-size: .85rem;
  font-family: ui-monospace, SFMono-Regular, Menlo, monospace; }
ul.plain { list-style: none; padding: 0; margin: 0; } ul.plain li { padding: .5rem 0; border-bottom: 1px solid var(--grid); }
ul.plain li:last-child { border-bottom: 0; } a { color: var(--accent); }
nav { font-size: .88rem; display: flex; flex-wrap: wrap; gap: .2rem 1rem; margin: 0 0 .4rem; } nav a { text-decoration: none; }
@media (max-width: 34rem) { section { padding: 1rem .85rem; border-radius: 12px; } th, td { padding: .34rem .35rem; }
  td small { display: block; margin: 0; } .bar { grid-template-columns: 7.6rem 1fr 2.6rem; gap: .5rem; font-size: .86rem; } .heat td { font-size: .8rem; min-width: 0; } }
@media print { body { background: #fff; } section, .figure { break-inside: avoid; } nav { display: none; } }
)";

std::string escaped(const std::string& text) { return html_escaped(text); }

/// Three significant digits.
std::string number(double x, const char* format = "%.3g") {
  if (!std::isfinite(x)) return "\u2013";
  char text[40];
  std::snprintf(text, sizeof text, format, std::abs(x) < 1e-12 ? 0.0 : x);
  std::string out = text;
  if (out[0] == '-') out = "\u2212" + out.substr(1);
  return out;
}

std::string percent(double x) {
  if (x > 0.0 && x < 0.005) return "<1\u00a0%";
  if (x >= 0.995) return ">99\u00a0%";
  return number(std::round(100.0 * x), "%.0f") + "\u00a0%";
}

/// `12 % to 15 %`, or one of them where they read alike.
std::string percents(double low, double high) {
  return percent(low) == percent(high) ? percent(low) : percent(low) + " to " + percent(high);
}

/// rad, or mrad where it is small.
std::string angle(double x) { return x < 1.0 ? number(1e3 * x) + "\u00a0mrad" : number(x) + "\u00a0rad"; }

std::string probability(double p) {
  if (p > 0.995) return ">0.99";
  if (p > 0.0 && p < 0.005) return "<0.01";
  return number(p, "%.2f");
}

/// `joint 4`, `joints 2 and 4`; empty for all of them.
std::string joints(const std::vector<int>& list, Eigen::Index of) {
  if (list.empty() || static_cast<Eigen::Index>(list.size()) == of) return "";
  std::vector<std::string> parts;
  for (const int j : list) parts.push_back(std::to_string(j));
  return std::string(list.size() > 1 ? "joints " : "joint ") + list_in_words(parts);
}

struct Tone {
  const char *badge, *tone;
};
Tone tone(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_gap:
      return {"No gap", "good"};
    case Verdict::not_detected:
      return {"Nothing detected", "calm"};
    case Verdict::explained:
      return {"Explained", "good"};
    case Verdict::partly_explained:
      return {"Partly explained", "warn"};
    case Verdict::unexplained:
      return {"Unexplained", "bad"};
    case Verdict::misread:
      return {"Log misread", "bad"};
    case Verdict::data_invalid:
      break;
  }
  return {"Data not usable", "bad"};
}

/// Joints, those with the largest gap in units of their floor first.
std::vector<Eigen::Index> worst_joints(const Diagnosis& d) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(d.rms.size()));
  std::iota(order.begin(), order.end(), Eigen::Index(0));
  const Eigen::VectorXd& scale = d.shrink.before.size() == d.rms.size() ? d.shrink.before : d.rms;
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return scale[a] / d.floor[a] > scale[b] / d.floor[b];
  });
  return order;
}

/// Energy shrink of each joint on the held-out rows, beyond the floor, with a 90 % interval by blocks of a
/// second drawn with replacement.
struct JointShrink {
  Eigen::VectorXd before, after, fraction, low, high;
};
JointShrink joint_shrink(const Diagnosis& d) {
  const GapSeries& s = d.series;
  const Eigen::Index n = d.floor.size();
  JointShrink out;
  out.before = out.after = out.fraction = out.low = out.high = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::MatrixXd> energy[2];  // of each block: 1 x n
  std::vector<double> rows;
  double open = -1.0;
  for (Eigen::Index i = 0; i < s.t.size(); ++i) {
    if (!s.held_out[static_cast<std::size_t>(i)]) continue;
    const double block = std::floor(s.t[i]) + 1e6 * s.log[static_cast<std::size_t>(i)];
    if (block != open || rows.empty()) {
      rows.push_back(0.0);
      for (auto& e : energy) e.emplace_back(Eigen::MatrixXd::Zero(1, n));
    }
    open = block;
    rows.back() += 1.0;
    energy[0].back() += s.before.row(i).cwiseAbs2();
    energy[1].back() += s.after.row(i).cwiseAbs2();
  }
  if (rows.empty()) return out;
  const auto fraction = [&](const Eigen::MatrixXd& b, const Eigen::MatrixXd& a, double count,
                            Eigen::Index j) {
    const double noise = d.floor[j] * d.floor[j], excess = b(0, j) / count - noise;
    return excess > 0.0 ? std::min(1.0, 1.0 - (a(0, j) / count - noise) / excess) : 0.0;
  };
  Eigen::MatrixXd sum[2] = {Eigen::MatrixXd::Zero(1, n), Eigen::MatrixXd::Zero(1, n)};
  double count = 0.0;
  for (std::size_t b = 0; b < rows.size(); ++b) {
    sum[0] += energy[0][b];
    sum[1] += energy[1][b];
    count += rows[b];
  }
  std::mt19937_64 random(1);
  constexpr int draws = 200;
  Eigen::MatrixXd drawn(draws, n);
  for (int k = 0; k < draws; ++k) {
    Eigen::MatrixXd e[2] = {Eigen::MatrixXd::Zero(1, n), Eigen::MatrixXd::Zero(1, n)};
    double c = 0.0;
    for (std::size_t b = 0; b < rows.size(); ++b) {
      const std::size_t pick = random() % rows.size();
      e[0] += energy[0][pick];
      e[1] += energy[1][pick];
      c += rows[pick];
    }
    for (Eigen::Index j = 0; j < n; ++j) drawn(k, j) = fraction(e[0], e[1], c, j);
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    out.before[j] = std::sqrt(sum[0](0, j) / count);
    out.after[j] = std::sqrt(sum[1](0, j) / count);
    out.fraction[j] = fraction(sum[0], sum[1], count, j);
    Eigen::VectorXd x = drawn.col(j);
    std::sort(x.data(), x.data() + x.size());
    out.low[j] = std::min(out.fraction[j], x[draws / 20]);
    out.high[j] = std::max(out.fraction[j], x[draws - 1 - draws / 20]);
  }
  return out;
}

/// A number for gnuplot, and a line of data.
std::string plain(double x) { return short_number(x, 5); }

/// The head of every plot: terminal, axes in the page's colours.
std::string plot_head(double height, const std::string& unit) {
  std::ostringstream out;
  out << "set terminal svg size 480," << height << " dynamic noenhanced font 'sans-serif,13'\n"
      << "set encoding utf8\nset border 3 lc rgb '" << rule
      << "'\nset tics nomirror scale 0.4 textcolor rgb '" << soft << "'\nset grid lc rgb '" << grid
      << "' lt 1 lw 1\nunset key\nset xlabel 't [s]' textcolor rgb '" << soft
      << "' offset 0,0.4\nset ylabel '" << unit << "' textcolor rgb '" << soft
      << "' offset 1.2,0\nset lmargin 8\nset rmargin 1.5\nset tmargin 0.6\nset bmargin 2.8\n";
  return out.str();
}

/// The drawing in the page's colours; empty without gnuplot.
std::string drawn(const std::string& commands, const std::string& name, const std::string& label) {
  std::string svg = plot_svg(commands, name);
  if (svg.empty()) return "";
  const auto replace = [&svg](const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = svg.find(from, at)) != std::string::npos; at += to.size())
      svg.replace(at, from.size(), to);
  };
  for (const Role& role : roles) {
    const std::string property = std::string("var(") + role.property + ")";
    char wide[32], narrow[32];
    std::snprintf(wide, sizeof wide, "rgb(%3d, %3d, %3d)", 0, 0, role.last);
    std::snprintf(narrow, sizeof narrow, "rgb(%d,%d,%d)", 0, 0, role.last);
    replace(wide, property);
    replace(narrow, property);
  }
  replace("font-family=\"sans-serif\"", "font-family=\"inherit\"");
  replace("<title>Gnuplot</title>", "<title>" + escaped(label) + "</title>");
  svg.replace(0, 4, "<svg role=\"img\" aria-label=\"" + escaped(label) + "\"");
  return svg;
}

/// The gap of one joint over time, before and after; of the log that judges.
std::string gap_plot(const Diagnosis& d, Eigen::Index joint, int log) {
  const GapSeries& s = d.series;
  std::ostringstream out;
  double first = 1e300, last = -1e300, reach = 3.0 * d.floor[joint];
  bool all_held = true;
  std::ostringstream data;
  double previous = 0.0;
  for (Eigen::Index i = 0; i < s.t.size(); ++i) {
    if (s.log[static_cast<std::size_t>(i)] != log) continue;
    if (s.t[i] - previous > gap_in_time && first < 1e300) data << "\n";
    previous = s.t[i];
    first = std::min(first, s.t[i]);
    last = std::max(last, s.t[i]);
    reach = std::max({reach, 1.08 * std::abs(s.before(i, joint)), 1.08 * std::abs(s.after(i, joint))});
    all_held = all_held && s.held_out[static_cast<std::size_t>(i)];
    data << plain(s.t[i]) << ' ' << plain(s.before(i, joint)) << ' ' << plain(s.after(i, joint)) << "\n";
  }
  if (first > last) return "";
  out << plot_head(230, "gap [N m]") << "set xrange [" << plain(first) << ":" << plain(last)
      << "]\nset yrange [" << plain(-reach) << ":" << plain(reach) << "]\n";
  int object = 1;
  const auto box = [&](double x0, double x1, double y0, double y1, const char* colour, double opacity) {
    out << "set object " << object++ << " rectangle from " << plain(x0) << "," << plain(y0) << " to "
        << plain(x1) << "," << plain(y1) << " behind fillcolor rgb '" << colour
        << "' fillstyle transparent solid " << opacity << " noborder\n";
  };
  box(first, last, -2.0 * d.floor[joint], 2.0 * d.floor[joint], floor_colour, 0.28);
  if (!all_held) {  // what was held out of one log
    double from = -1.0, to = -1.0;
    for (Eigen::Index i = 0; i < s.t.size(); ++i) {
      const bool held = s.held_out[static_cast<std::size_t>(i)] && s.log[static_cast<std::size_t>(i)] == log;
      if (held && from < 0.0) from = s.t[i];
      if (held) to = s.t[i];
      if ((!held || i + 1 == s.t.size()) && from >= 0.0) {
        box(from, to, -reach, reach, after_colour, 0.07);
        from = -1.0;
      }
    }
  }
  out << "$d << END\n"
      << data.str() << "END\nplot $d using 1:2 with lines lw 1.6 lc rgb '" << before_colour
      << "' notitle, $d using 1:3 with lines lw 1.6 lc rgb '" << after_colour << "' notitle\n";
  const std::string label = "Gap of joint " + std::to_string(joint + 1) + " over time, before and after";
  return drawn(out.str(), "gap" + std::to_string(joint + 1), label);
}

/// One joint's replayed position (within what was measured, and half as much again) or its error.
std::string replay_plot(const Rollout& r, Eigen::Index joint, bool error) {
  std::ostringstream out, data;
  double low = 1e300, high = -1e300, end = 0.0;
  for (Eigen::Index i = 0; i < r.t.size() && r.t[i] < r.t[0] + replay_shown; ++i) {
    const bool fresh = i == 0 || r.start[i] != r.start[i - 1];
    if (fresh && i > 0) data << "\n";
    const double q = r.q(i, joint), without = r.without(i, joint), with = r.with(i, joint);
    low = std::min(low, q);
    high = std::max(high, q);
    end = r.t[i];
    if (!error)
      data << plain(r.t[i]) << ' ' << plain(q) << ' ' << plain(without) << ' ' << plain(with) << "\n";
    else if (!fresh)
      data << plain(r.t[i]) << " 0 " << plain(std::max(1e-4, 1e3 * std::abs(without - q))) << ' '
           << plain(std::max(1e-4, 1e3 * std::abs(with - q))) << "\n";
  }
  const double room = 0.5 * std::max(high - low, 0.02);
  out << plot_head(230, error ? "error [mrad]" : "position [rad]") << "set xrange [" << plain(r.t[0]) << ":"
      << plain(end) << "]\n";
  if (error)
    out << "set logscale y\nset yrange [0.01:*]\nset format y '%g'\n";
  else
    out << "set yrange [" << plain(low - room) << ":" << plain(high + room) << "]\n";
  out << "$d << END\n" << data.str() << "END\nplot ";
  if (!error) out << "$d using 1:2 with lines lw 4 lc rgb '" << floor_colour << "' notitle, ";
  out << "$d using 1:3 with lines lw 1.6 lc rgb '" << before_colour
      << "' notitle, $d using 1:4 with lines lw 1.6 lc rgb '" << after_colour << "' notitle\n";
  const std::string name = std::to_string(joint + 1);
  return drawn(out.str(), (error ? "error" : "replay") + name,
               (error ? "Error of the replayed position of joint " : "Replayed position of joint ") + name);
}

constexpr const char* speed_group = "Speed";
/// The group that a regime is of; within one, the regimes share the gap out among them.
std::string group_of(const std::string& regime) {
  if (regime == "forward" || regime == "backward") return "Direction";
  if (regime.find("load") != std::string::npos) return "Load";
  if (regime.find("acceleration") != std::string::npos) return "Acceleration";
  if (regime.find("third") != std::string::npos) return "Time";
  return speed_group;
}

class Page {
 public:
  Page(const Diagnosis& d, const ReportContext& context)
      : d_(d), context_(context), n_(d.rms.size()), worst_(worst_joints(d)), held_log_(0) {
    for (std::size_t i = 0; i < d.series.held_out.size(); ++i)
      if (d.series.held_out[i]) held_log_ = d.series.log[i];
  }

  std::string html() {
    const Tone t = tone(d_.verdict);
    const std::string sentence = verdict_sentence(d_);
    out_ << "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\"><head><meta "
            "charset=\"utf-8\"/>"
            "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/><title>"
         << escaped(t.badge) << ": sim-to-real gap of " << escaped(context_.robot) << "</title><style>"
         << style
         << "</style></head><body><main>\n<header id=\"verdict\"><p class=\"kicker\">Sim-to-real gap of "
         << escaped(context_.robot) << " \u00b7 " << escaped(list_in_words(file_names()))
         << "</p><span class=\"badge " << t.tone << "\">" << t.badge
         << (sentence.size() > 120 ? "</span><h1 class=\"long\">" : "</span><h1>") << escaped(sentence)
         << "</h1></header>\n";
    figures();
    out_ << "<nav aria-label=\"Sections\"><a href=\"#answerable\">Log</a><a href=\"#effects\">Effects</a><a "
            "href=\"#where\">Where</a>"
            "<a href=\"#residual\">Over time</a><a href=\"#shrink\">Shrink</a><a href=\"#replay\">Replay</a>"
            "<a href=\"#ranking\">Ranking</a><a href=\"#data\">Data</a><a href=\"#next\">Next</a>"
            "<a href=\"#reproduce\">Reproduce</a></nav>\n";
    out_ << detail::answerable_section(d_);
    effects();
    where();
    residual();
    shrink();
    replay();
    ranking();
    data();
    next();
    reproduce();
    out_ << "</main></body></html>\n";
    return out_.str();
  }

 private:
  std::vector<std::string> file_names() const {
    std::vector<std::string> names;
    for (const std::string& log : context_.logs) names.push_back(log.substr(log.find_last_of('/') + 1));
    return names;
  }

  void open(const char* id, const char* title) {
    out_ << "<section id=\"" << id << "\"><h2>" << title << "</h2>\n";
  }

  void figure(const std::string& value, const std::string& text) {
    out_ << "<div class=\"figure\"><b>" << escaped(value) << "</b><span>" << escaped(text)
         << "</span></div>\n";
  }

  void figures() {
    out_ << "<div class=\"figures\">\n";
    if (!d_.effects.empty()) {
      figure(percent(d_.shrink.fraction),
             "of the gap goes away on data not used (" + percents(d_.shrink.low, d_.shrink.high) + ")");
      figure(probability(d_.effects.front().probability),
             "probability of " + with_spaces(d_.effects.front().effect.name));
    }
    if (!worst_.empty()) {
      const Eigen::Index j = worst_.front();
      figure(number(d_.rms[j]) + "\u00a0N\u00a0m",
             "rms gap of joint " + std::to_string(j + 1) + ", " +
                 number(d_.rms[j] / d_.floor[j], d_.rms[j] < 10.0 * d_.floor[j] ? "%.1f" : "%.0f") +
                 " times its floor");
    }
    if (d_.rollout.horizon.size() > 0) {
      const Eigen::Index k = d_.rollout.horizon.size() / 2;
      figure(
          angle(d_.rollout.before[k]) + (d_.effects.empty() ? "" : " \u2192 " + angle(d_.rollout.after[k])),
          "error of the motion after " + number(d_.rollout.horizon[k]) + " s of replay");
    }
    figure(number(d_.p_value, "%.2g"), "p-value: chance of such a gap from noise and tolerance alone");
    out_ << "</div>\n";
  }

  void effects() {
    open("effects", "What makes the gap");
    if (d_.effects.empty())
      out_ << "<p>No effect of the catalogue is named. The ranking below says how the candidates "
              "compare.</p>\n";
    for (const FoundEffect& e : d_.effects) {
      const std::string where = joints(e.effect.joints, n_);
      out_ << "<div class=\"effect\"><h3>" << escaped(capitalised(with_spaces(e.effect.name)))
           << (where.empty() ? ", whole arm" : ", " + where) << "</h3><p class=\"note\">Probability "
           << escaped(probability(e.probability)) << ", " << escaped(percent(e.share))
           << " of what is explained.";
      out_ << "</p>\n";
      if (!e.aliases.empty()) {
        std::vector<std::string> names;
        for (const std::string& a : e.aliases) names.push_back("<b>" + escaped(with_spaces(a)) + "</b>");
        out_ << "<p class=\"alias\">These logs cannot tell it from " << list_in_words(names)
             << ": see <a href=\"#next\">the next experiment</a>.</p>\n";
      }
      parameters(e);
      out_ << "</div>\n";
    }
    out_ << "<div id=\"aliases\"><p class=\"note\">";
    const bool any = std::any_of(d_.effects.begin(), d_.effects.end(),
                                 [](const FoundEffect& e) { return !e.aliases.empty(); });
    if (d_.effects.empty())
      out_ << "Aliases: none, as no effect was adopted.";
    else if (!any)
      out_ << "Aliases: none. No other effect of the catalogue explains these logs as well.";
    else
      out_ << "Aliases are effects that make nearly the same torques on these motions: any of a class may be "
              "the cause.";
    if (d_.nominal_error > 0.0)
      out_ << " The data ask for nominal parameters that are off by about "
           << number(100.0 * d_.nominal_error) << " %; that was allowed for.";
    out_ << "</p></div></section>\n";
  }

  static std::string header(const Estimate& p) {
    std::string unit = p.unit == "1" ? "" : " [" + p.unit + "]";
    if (const std::size_t square = unit.find("^2"); square != std::string::npos)
      unit.replace(square, 2, "\u00b2");
    return escaped(with_spaces(p.key) + unit);
  }

  static std::string estimate(const Estimate& p, Eigen::Index k) {
    const char* format = std::abs(p.value[k]) < 1e5 ? "%.3g" : "%.2f";  // a stamp counts from 1970
    return number(p.value[k], format) + "<small>" + number(p.low[k], format) + " \u2026 " +
           number(p.high[k], format) + "</small>";
  }

  void parameters(const FoundEffect& e) {
    std::vector<const Estimate*> lists, others;
    for (const Estimate& p : e.parameters) (p.per_joint ? lists : others).push_back(&p);
    if (!lists.empty()) {
      out_ << "<div class=\"scroll\"><table class=\"fit\"><thead><tr><th>joint</th>";
      for (const Estimate* p : lists) out_ << "<th>" << header(*p) << "</th>";
      out_ << "</tr></thead><tbody>\n";
      for (const int j : e.effect.joints) {
        out_ << "<tr><td>" << j << "</td>";
        for (const Estimate* p : lists) out_ << "<td>" << estimate(*p, j - 1) << "</td>";
        out_ << "</tr>\n";
      }
      out_ << "</tbody></table></div>\n";
    }
    if (others.empty()) return;
    static const char* const axes[] = {"x", "y", "z"};
    static const char* const tensor[] = {"xx", "xy", "xz", "yy", "yz", "zz"};
    static const char* const standard[] = {"xx", "xy", "yy", "xz", "yz", "zz"};
    out_ << "<div class=\"scroll\"><table class=\"fit\"><thead><tr><th>parameter</th><th>value, 90 % "
            "interval</th></tr></thead><tbody>\n";
    for (const Estimate* p : others) {
      for (Eigen::Index k = 0; k < p->value.size(); ++k) {
        std::string name = header(*p);
        if (p->value.size() == 3)
          name += std::string(" ") + axes[k];
        else if (p->value.size() == 6)
          name += std::string(" ") + (p->key == "inertia_about_origin" ? standard[k] : tensor[k]);
        else if (p->value.size() > 1)
          name += " " + std::to_string(k + 1);
        out_ << "<tr><td>" << name << "</td><td>" << estimate(*p, k) << "</td></tr>\n";
      }
    }
    out_ << "</tbody></table></div>\n";
  }

  void where() {
    open("where", "Where the gap is");
    out_ << "<p class=\"note\">Part of the gap's energy, in percent, by joint and regime, every joint in "
            "units of its noise "
            "floor. Framed cells hold more of their joint's gap than chance gives (p at most 0.05).</p>\n";
    std::vector<std::string> regimes;
    double most = 1e-12;
    for (const GapCell& c : d_.where) {
      if (std::find(regimes.begin(), regimes.end(), c.regime) == regimes.end()) regimes.push_back(c.regime);
      most = std::max(most, c.share);
    }
    out_ << "<div class=\"scroll\"><table class=\"heat\"><thead><tr><th></th>";
    for (Eigen::Index j = 1; j <= n_; ++j) out_ << "<th scope=\"col\">J" << j << "</th>";
    out_ << "</tr></thead><tbody>\n";
    std::string group;
    for (const std::string& regime : regimes) {
      if (group_of(regime) != group) {
        group = group_of(regime);
        out_ << "<tr><th class=\"group\" colspan=\"" << n_ + 1 << "\">" << group << "</th></tr>\n";
      }
      out_ << "<tr><th scope=\"row\">" << escaped(regime) << "</th>";
      for (int j = 1; j <= n_; ++j) {
        const auto cell = std::find_if(d_.where.begin(), d_.where.end(),
                                       [&](const GapCell& c) { return c.joint == j && c.regime == regime; });
        if (cell == d_.where.end()) {
          out_ << "<td class=\"none\">\u00b7</td>";
          continue;
        }
        out_ << "<td class=\"cell" << (cell->p_value <= 0.05 && cell->share >= 0.005 ? " sure" : "")
             << "\" style=\"--a:" << plain(0.85 * std::max(0.0, cell->share) / most) << "\" title=\"joint "
             << j << ", " << escaped(regime) << ": p = " << plain(cell->p_value) << "\">"
             << number(std::round(100.0 * cell->share), "%.0f") << "</td>";
      }
      out_ << "</tr>\n";
    }
    out_ << "</tbody></table></div>\n";
    if (!d_.windows.empty()) {
      out_ << "<h3>In time</h3><ul class=\"plain\">\n";
      for (const GapWindow& w : d_.windows)
        out_ << "<li>From " << number(w.t0, "%.2f") << " s to " << number(w.t1, "%.2f") << " s of "
             << escaped(w.log.substr(w.log.find_last_of('/') + 1))
             << " the gap is far larger than elsewhere, on "
             << (joints(w.joints, n_).empty() ? "all joints" : joints(w.joints, n_)) << ".</li>\n";
      out_ << "</ul>\n";
    }
    out_ << "</section>\n";
  }

  void legend(bool replayed) {
    out_ << "<ul class=\"legend\">";
    if (replayed) out_ << "<li><i style=\"background:var(--floor)\"></i>measured</li>";
    out_ << "<li><i style=\"background:var(--before)\"></i>nominal model</li><li><i "
            "style=\"background:var(--after)\"></i>with "
            "the effects</li>";
    if (!replayed)
      out_ << "<li><i style=\"background:var(--floor);opacity:.5;height:.7rem\"></i>noise, \u00b12 "
              "\u03c3</li>";
    out_ << "</ul>\n";
  }

  void missing_plots() {
    out_ << "<p class=\"note missing\">The plots are missing: gnuplot is not installed on the machine that "
            "wrote this "
            "report.</p>\n";
  }

  /// One of several logs only judges; else parts of one do.
  bool whole_log_held() const {
    for (std::size_t i = 0; i < d_.series.held_out.size(); ++i)
      if (d_.series.log[i] == held_log_ && !d_.series.held_out[i]) return false;
    return d_.logs.size() > 1;
  }

  void residual() {
    open("residual", "The gap over time, before and after");
    if (d_.series.t.size() == 0) {
      out_ << "<p class=\"note\">No rows.</p></section>\n";
      return;
    }
    const bool whole = whole_log_held();
    out_ << "<p class=\"note\">Measured less modelled torque, below " << number(d_.cutoff)
         << " Hz, of the joints where it is "
         << "largest against their noise"
         << (whole ? ", in the log that took no part in choosing or fitting (" +
                         escaped(file_names()[static_cast<std::size_t>(held_log_)]) + ")"
                   : std::string(". What is shaded took no part in choosing or fitting"))
         << ".</p>\n";
    legend(false);
    std::ostringstream plots;
    for (std::size_t k = 0; k < std::min(most_plots, worst_.size()); ++k) {
      const std::string svg = gap_plot(d_, worst_[k], held_log_);
      if (svg.empty()) continue;
      plots << "<figure><figcaption>Joint " << worst_[k] + 1 << "</figcaption>" << svg << "</figure>\n";
    }
    if (plots.str().empty())
      missing_plots();
    else
      out_ << "<div class=\"plots\">" << plots.str() << "</div>\n";
    out_ << "</section>\n";
  }

  void shrink() {
    open("shrink", "How far it shrinks");
    const JointShrink s = joint_shrink(d_);
    if (d_.effects.empty())
      out_ << "<p class=\"note\">No effect was adopted: nothing shrinks.</p>\n";
    else
      out_ << "<p>All joints together: <b>" << escaped(percent(d_.shrink.fraction))
           << "</b> of the gap's energy beyond the noise ("
           << escaped(percents(d_.shrink.low, d_.shrink.high))
           << ", 90 % interval by blocks of a second), on data that neither chose nor fitted anything.</p>\n";
    out_ << "<div "
            "class=\"scroll\"><table><thead><tr><th>joint</th><th>before</th><th>after</th><th>floor</th>";
    if (!d_.effects.empty()) out_ << "<th>shrink</th><th>90 % interval</th>";
    out_ << "</tr></thead><tbody>\n";
    for (Eigen::Index j = 0; j < n_; ++j) {
      out_ << "<tr><td>" << j + 1 << "</td><td>" << number(s.before[j]) << "</td><td>" << number(s.after[j])
           << "</td><td>" << number(d_.floor[j]) << "</td>";
      if (!d_.effects.empty() && s.before[j] * s.before[j] > 2.0 * d_.floor[j] * d_.floor[j]) {
        const double low = std::clamp(s.low[j], 0.0, 1.0), high = std::clamp(s.high[j], 0.0, 1.0),
                     at = std::clamp(s.fraction[j], 0.0, 1.0);
        out_ << "<td>" << escaped(percent(s.fraction[j])) << "</td><td><div class=\"span\" title=\""
             << escaped(percents(s.low[j], s.high[j])) << "\" style=\"--l:" << plain(100 * low)
             << "%;--w:" << plain(std::max(0.5, 100 * (high - low))) << "%;--x:" << plain(100 * at)
             << "%\"><u></u><b></b></div></td>";
      } else if (!d_.effects.empty()) {
        out_ << "<td class=\"note\">no gap</td><td></td>";
      }
      out_ << "</tr>\n";
    }
    out_ << "</tbody></table></div><p class=\"note\">Torques in N m rms, held out.</p></section>\n";
  }

  void replay() {
    open("replay", "The motion, replayed");
    const Rollout& r = d_.rollout;
    if (r.horizon.size() == 0) {
      out_ << "<p class=\"note\">No replay: no held-out stretch is long enough, or the nominal model has no "
              "motion under "
              "these torques.</p></section>\n";
      return;
    }
    out_ << "<p class=\"note\">What a simulator makes of the measured torques, from measured states on, "
            "every second anew: the error at "
            "the end of each horizon, rms over joints, median over starts.</p>\n"
         << "<div class=\"scroll\"><table><thead><tr><th>horizon</th><th>nominal model</th><th>with the "
            "effects</th></tr></thead><tbody>\n";
    for (Eigen::Index k = 0; k < r.horizon.size(); ++k)
      out_ << "<tr><td>" << number(r.horizon[k]) << " s</td><td>" << angle(r.before[k]) << "</td><td>"
           << angle(r.after[k]) << "</td></tr>\n";
    out_ << "</tbody></table></div>\n";
    // The joints that the nominal model carries off most; a light one may run far away.
    const Eigen::VectorXd off = (r.without - r.q).cwiseAbs().cwiseMin(1.0).colwise().mean().transpose();
    std::vector<Eigen::Index> order(static_cast<std::size_t>(n_));
    std::iota(order.begin(), order.end(), Eigen::Index(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](Eigen::Index a, Eigen::Index b) { return off[a] > off[b]; });
    order.resize(std::min<std::size_t>(2, order.size()));
    std::ostringstream plots;
    for (const bool error : {false, true}) {
      for (const Eigen::Index j : order) {
        const std::string svg = replay_plot(r, j, error);
        if (svg.empty()) continue;
        plots << "<figure><figcaption>Joint " << j + 1 << (error ? ", error of the replay" : ", position")
              << "</figcaption>" << svg << "</figure>\n";
      }
    }
    if (plots.str().empty()) {
      missing_plots();
    } else {
      legend(true);
      out_ << "<div class=\"plots\">" << plots.str() << "</div>\n";
    }
    out_ << "</section>\n";
  }

  void ranking() {
    open("ranking", "Which effect: the ranking");
    out_ << "<p class=\"note\">Probability of each effect to be the first cause; what is missing to 1 is for "
            "none of these.</p>\n";
    std::vector<std::string> rest;
    for (const auto& [name, p, alone] : d_.ranking) {
      if (p < 0.001) {
        rest.push_back(with_spaces(name));
        continue;
      }
      const bool adopted =
          std::any_of(d_.effects.begin(), d_.effects.end(),
                      [&name = name](const FoundEffect& e) { return e.effect.name == name; });
      out_ << "<div class=\"bar" << (adopted ? "" : " rest") << "\"><span>" << escaped(with_spaces(name))
           << "</span><i><u style=\"--w:" << plain(100.0 * p) << "%\"></u></i><span>"
           << escaped(probability(p)) << "</span></div>\n";
    }
    if (!rest.empty()) out_ << "<p class=\"note\">Below 0.001: " << escaped(list_in_words(rest)) << ".</p>\n";
    out_ << "</section>\n";
  }

  void data() {
    open("data", "The data");
    for (std::size_t l = 0; l < d_.logs.size(); ++l) {
      const DataReport& report = d_.logs[l].report;
      out_ << "<h3>" << escaped(l < context_.logs.size() ? file_names()[l] : d_.logs[l].source)
           << "</h3><p class=\"note\">" << report.samples << " samples at " << number(report.rate_hz)
           << " Hz, " << number(report.duration) << " s, looked at below " << number(d_.cutoff) << " Hz"
           << (d_.logs.size() < 2  ? ""
               : !whole_log_held() ? static_cast<int>(l) == held_log_ ? "; the gap is in this one" : ""
               : static_cast<int>(l) == held_log_ ? "; it judges only"
                                                  : "; it chooses and fits")
           << ".</p>\n";
      if (report.issues.empty()) {
        out_ << "<p>No issue found.</p>\n";
        continue;
      }
      out_ << "<ul class=\"plain\">\n";
      for (const DataIssue& issue : report.issues) {
        const std::string where = joints(issue.joints, n_);
        out_ << "<li><b>" << escaped(capitalised(with_spaces(issue.name))) << "</b>"
             << (where.empty() ? "" : " (" + where + ")") << ": " << escaped(issue.text) << "</li>\n";
      }
      out_ << "</ul>\n";
    }
    out_ << "</section>\n";
  }

  void next() {
    open("next", "Next experiment");
    out_ << "<p>" << escaped(d_.next.text) << "</p>\n";
    if (!d_.next.separates.empty()) {
      out_ << "<ul>\n";
      for (const auto& [a, b] : d_.next.separates)
        out_ << "<li>tells " << escaped(with_spaces(a)) << " from " << escaped(with_spaces(b)) << "</li>\n";
      out_ << "</ul>\n";
    }
    out_ << "</section>\n";
  }

  void reproduce() {
    open("reproduce", "How to reproduce");
    out_ << "<pre>" << escaped(context_.command) << "</pre><p class=\"note\">dynid "
         << escaped(context_.version) << "; "
         << (context_.referenced ? "the nominal model was fitted to the healthy log first (view B)"
                                 : "the nominal model is taken as given (view A)")
         << "; " << number(d_.seconds, "%.1f")
         << " s of computing. The same seed gives the same result.</p></section>\n";
  }

  const Diagnosis& d_;
  const ReportContext& context_;
  Eigen::Index n_;
  std::vector<Eigen::Index> worst_;
  int held_log_;
  std::ostringstream out_;
};

}  // namespace

std::string verdict_sentence(const Diagnosis& d) {
  std::vector<std::string> causes;
  for (const FoundEffect& e : d.effects) {
    const std::string where = joints(e.effect.joints, d.rms.size());
    std::string cause = with_spaces(e.effect.name);
    const auto mass = std::find_if(e.parameters.begin(), e.parameters.end(),
                                   [](const Estimate& p) { return p.key == "mass"; });
    if (e.effect.name == "payload" && mass != e.parameters.end())
      cause = "a payload of " + number(mass->value[0]) + " kg";
    else if (!where.empty())
      cause += " on " + where;
    if (!e.aliases.empty()) {
      std::vector<std::string> others;
      for (const std::string& a : e.aliases) others.push_back(with_spaces(a));
      cause += " (or " + list_in_words(others) + ", which these logs cannot tell from it)";
    }
    causes.push_back(cause);
  }
  const std::string shrink = percent(std::max(0.0, d.shrink.fraction));
  const bool several = causes.size() > 1;
  switch (d.verdict) {
    case Verdict::no_gap:
      return "No gap: the model's torques agree with the robot's to within the noise.";
    case Verdict::not_detected:
      return "No cause can be named: model and robot differ by no more than an inexact model may.";
    case Verdict::explained:
      return capitalised(list_in_words(causes)) + (several ? " explain" : " explains") + " the gap: with " +
             (several ? "them" : "it") + " in the model, " + shrink +
             " of it goes away on data that took no part.";
    case Verdict::partly_explained:
      return capitalised(list_in_words(causes)) + (several ? " explain" : " explains") +
             " part of the gap: " + shrink +
             " of it goes away on data that took no part; the rest is none of the known effects.";
    case Verdict::unexplained:
      return "There is a gap, and none of the known effects explains it.";
    case Verdict::misread: {
      std::vector<std::string> texts;
      for (const Convention& c : d.conventions.conventions) texts.push_back(c.text);
      return "The log does not mean what the model takes it to mean: " + join(texts, "; ") +
             "; read it with --assume " + d.conventions.assume + ".";
    }
    case Verdict::data_invalid:
      break;
  }
  return "These logs cannot be judged: see the data issues.";
}

std::string to_html(const Diagnosis& diagnosis, const ReportContext& context) {
  return Page(diagnosis, context).html();
}

}  // namespace dynid
