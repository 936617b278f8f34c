// SPDX-License-Identifier: Apache-2.0
#include "report_plots.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "base/plot.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid::detail {
namespace {

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
                     *floor_colour = roles[5].colour;

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
  replace("<title>Gnuplot</title>", "<title>" + html_escaped(label) + "</title>");
  svg.replace(0, 4, "<svg role=\"img\" aria-label=\"" + html_escaped(label) + "\"");
  return svg;
}

}  // namespace

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
  const std::string unit = d.unit.empty() ? "N m" : d.unit[static_cast<std::size_t>(joint)];
  out << plot_head(230, "gap [" + unit + "]") << "set xrange [" << plain(first) << ":" << plain(last)
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

}  // namespace dynid::detail
