// SPDX-License-Identifier: Apache-2.0
//
// The plots of the pages: their data, once, for the script that draws them, and gnuplot's drawings for who
// runs no scripts and for print.
#include "page_plots.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/page.hpp"
#include "base/plot.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid::detail {
namespace {

using nlohmann::json;

constexpr Eigen::Index drawn_width = 240;  // [px]: half of the drawing's, and its lines are wider than one
constexpr int resolution = 4;              // digits of the largest value of a column
constexpr double least_error = 0.01;       // of what is drawn on a logarithmic scale: its lower end

// Colours as gnuplot is told them, and the custom property of the page that each becomes.
struct Role {
  const char *colour, *property;
  int last;
};
constexpr Role roles[] = {{"#000001", "--rule", 1},   {"#000002", "--grid", 2},  {"#000003", "--soft", 3},
                          {"#000004", "--before", 4}, {"#000005", "--after", 5}, {"#000006", "--floor", 6},
                          {"#000007", "--ink", 7}};

std::string colour_of(const std::string& property) {
  for (const Role& role : roles)
    if (property == role.property) return role.colour;
  return roles[6].colour;
}

/// A number for gnuplot.
std::string plain(double x) { return short_number(x, 5); }

/// The head of every plot: terminal, axes in the page's colours.
std::string plot_head(const std::string& axis) {
  const std::string rule = colour_of("--rule"), grid = colour_of("--grid"), soft = colour_of("--soft");
  std::ostringstream out;
  out << "set terminal svg size 480,230 dynamic noenhanced font 'sans-serif,13'\n"
      << "set encoding utf8\nset border 3 lc rgb '" << rule
      << "'\nset tics nomirror scale 0.4 textcolor rgb '" << soft << "'\nset grid lc rgb '" << grid
      << "' lt 1 lw 1\nunset key\nset xlabel 't [s]' textcolor rgb '" << soft
      << "' offset 0,0.4\nset ylabel '" << axis << "' textcolor rgb '" << soft
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
    const std::string property = std::string("var(") + role.property + ")", last = std::to_string(role.last);
    replace("rgb(  0,   0,   " + last + ")", property);
    replace("rgb(0,0," + last + ")", property);
  }
  replace("font-family=\"sans-serif\"", "font-family=\"inherit\"");
  replace("<title>Gnuplot</title>", "<title>" + html_escaped(label) + "</title>");
  svg.replace(0, 4, "<svg role=\"img\" aria-label=\"" + html_escaped(label) + "\"");
  return svg;
}

double value_of(const PlotLine& line, const Eigen::MatrixXd& columns, Eigen::Index row) {
  const double x = columns(row, line.column);
  return line.less < 0 ? x : std::max(least_error, 1e3 * std::abs(x - columns(row, line.less)));
}

/// `group` is thinned to the drawing's width.
std::string svg_of(const Plot& plot, const PlotGroup& group, const std::string& name) {
  std::ostringstream out;
  const double first = group.t[0], last = group.t[group.t.size() - 1];
  out << plot_head(plot.axis) << "set xrange [" << plain(first) << ":" << plain(last) << "]\nset yrange ["
      << plain(plot.low) << ":" << plain(plot.high) << "]\n";
  if (plot.logarithmic) out << "set logscale y\nset format y '%g'\n";
  int object = 1;
  const auto box = [&](double x0, double x1, double y0, double y1, const char* property, double opacity) {
    out << "set object " << object++ << " rectangle from " << plain(x0) << "," << plain(y0) << " to "
        << plain(x1) << "," << plain(y1) << " behind fillcolor rgb '" << colour_of(property)
        << "' fillstyle transparent solid " << opacity << " noborder\n";
  };
  if (plot.band > 0.0) box(first, last, -plot.band, plot.band, "--floor", 0.28);
  for (const auto& [from, to] : group.shaded) box(from, to, plot.low, plot.high, "--after", 0.07);
  out << "$d << END\n";
  for (Eigen::Index i = 0; i < group.t.size(); ++i) {
    if (!std::isnan(group.columns(i, 0))) {
      out << plain(group.t[i]);
      for (const PlotLine& line : plot.lines) out << ' ' << plain(value_of(line, group.columns, i));
    }
    out << '\n';
  }
  out << "END\nplot ";
  for (std::size_t k = 0; k < plot.lines.size(); ++k)
    out << (k > 0 ? ", " : "") << "$d using 1:" << k + 2 << " with lines lw " << plot.lines[k].width
        << " lc rgb '" << colour_of(plot.lines[k].property) << "' notitle";
  out << '\n';
  return drawn(out.str(), name, plot.label);
}

std::string plot_id(const PlotGroup& group, std::size_t k) { return group.id + "_" + std::to_string(k + 1); }

/// Whole numbers of a power of ten: `unit`, `values`, null where a line breaks. Shorter than decimals by
/// half.
json packed(const Eigen::VectorXd& x, double unit) {
  json values = json::array();
  for (const double value : x) {
    if (std::isfinite(value))
      values.push_back(static_cast<long long>(std::llround(std::clamp(value / unit, -1e15, 1e15))));
    else
      values.push_back(nullptr);
  }
  return {{"unit", unit}, {"values", std::move(values)}};
}

double largest_of(const Eigen::VectorXd& x) {
  double most = 0.0;
  for (const double value : x)
    if (std::isfinite(value)) most = std::max(most, std::abs(value));
  return most;
}

/// The power of ten that leaves `largest` so many digits.
double unit_for(double largest, int digits) {
  return largest > 0.0 ? std::pow(10.0, std::floor(std::log10(largest)) + 1 - digits) : 1.0;
}

json data_of(const PlotGroup& group) {
  std::vector<bool> differs(static_cast<std::size_t>(group.columns.cols()), false);
  for (const Plot& plot : group.plots)
    for (const PlotLine& line : plot.lines)
      if (line.less >= 0)
        for (const int column : {line.column, line.less}) differs[static_cast<std::size_t>(column)] = true;
  json columns = json::array(), plots = json::array();
  for (Eigen::Index c = 0; c < group.columns.cols(); ++c) {
    // Of a difference a hundredth of a thousandth is seen.
    double unit = unit_for(largest_of(group.columns.col(c)), resolution);
    if (differs[static_cast<std::size_t>(c)]) unit = std::min(unit, 1e-5);
    columns.push_back(packed(group.columns.col(c), unit));
  }
  for (std::size_t k = 0; k < group.plots.size(); ++k) {
    const Plot& plot = group.plots[k];
    json lines = json::array();
    for (const PlotLine& line : plot.lines)
      lines.push_back({{"name", line.name},
                       {"colour", line.property},
                       {"column", line.column},
                       {"less", line.less},
                       {"width", line.width}});
    plots.push_back({{"id", plot_id(group, k)},
                     {"joint", plot.joint},
                     {"label", plot.label},
                     {"axis", plot.axis},
                     {"log", plot.logarithmic},
                     {"range", {plot.low, plot.high}},
                     {"band", plot.band},
                     {"lines", std::move(lines)}});
  }
  return {{"id", group.id},
          {"t", packed(group.t, unit_for(largest_of(group.t), resolution + 1))},
          {"columns", std::move(columns)},
          {"shaded", group.shaded},
          {"plots", std::move(plots)}};
}

/// `rows` rows to `to`, beginning with `begin`, for no more than `pixels` pixels.
void thin_stretch(const Eigen::VectorXd& t, const Eigen::MatrixXd& columns, Eigen::Index begin,
                  Eigen::Index rows, Eigen::Index pixels, std::vector<double>& times,
                  std::vector<Eigen::RowVectorXd>& to) {
  if (rows <= 2 * pixels) {
    for (Eigen::Index i = begin; i < begin + rows; ++i) {
      times.push_back(t[i]);
      to.emplace_back(columns.row(i));
    }
    return;
  }
  for (Eigen::Index p = 0; p < pixels; ++p) {
    const Eigen::Index first = begin + p * rows / pixels, count = begin + (p + 1) * rows / pixels - first;
    Eigen::RowVectorXd one(columns.cols()), two(columns.cols());
    for (Eigen::Index c = 0; c < columns.cols(); ++c) {
      Eigen::Index low = 0, high = 0;
      const double least = columns.col(c).segment(first, count).minCoeff(&low),
                   most = columns.col(c).segment(first, count).maxCoeff(&high);
      one[c] = low <= high ? least : most;
      two[c] = low <= high ? most : least;
    }
    times.push_back(t[first]);
    times.push_back(t[first + count - 1]);
    to.push_back(std::move(one));
    to.push_back(std::move(two));
  }
}

}  // namespace

PlotGroup thinned(const Eigen::VectorXd& t, const Eigen::MatrixXd& columns, const std::vector<bool>& fresh,
                  Eigen::Index width) {
  std::vector<double> times;
  std::vector<Eigen::RowVectorXd> rows;
  const Eigen::Index size = t.size();
  const auto begins = [&fresh](Eigen::Index i) {
    return static_cast<std::size_t>(i) < fresh.size() && fresh[static_cast<std::size_t>(i)];
  };
  for (Eigen::Index begin = 0; begin < size;) {
    Eigen::Index end = begin + 1;
    while (end < size && !begins(end)) ++end;
    if (begin > 0) {
      times.push_back(t[begin]);
      rows.emplace_back(
          Eigen::RowVectorXd::Constant(columns.cols(), std::numeric_limits<double>::quiet_NaN()));
    }
    thin_stretch(t, columns, begin, end - begin, std::max<Eigen::Index>(1, width * (end - begin) / size),
                 times, rows);
    begin = end;
  }
  PlotGroup out;
  out.t = Eigen::Map<const Eigen::VectorXd>(times.data(), static_cast<Eigen::Index>(times.size()));
  out.columns.resize(out.t.size(), columns.cols());
  for (std::size_t i = 0; i < rows.size(); ++i) out.columns.row(static_cast<Eigen::Index>(i)) = rows[i];
  return out;
}

json plots_view(const PlotGroup& group) {
  json plots = json::array();
  const bool live = has_page_template("uplot_script");
  bool drawn_any = false;
  PlotGroup coarse = group;
  if (group.t.size() > 2 * drawn_width) {  // what was thinned is thinned again, stretch by stretch
    std::vector<Eigen::Index> kept;
    std::vector<bool> fresh;
    bool next = false;
    for (Eigen::Index i = 0; i < group.t.size(); ++i) {
      if (std::isnan(group.columns(i, 0))) {
        next = true;
        continue;
      }
      kept.push_back(i);
      fresh.push_back(next);
      next = false;
    }
    PlotGroup again = thinned(group.t(kept), group.columns(kept, Eigen::all), fresh, drawn_width);
    coarse.t = std::move(again.t);
    coarse.columns = std::move(again.columns);
  }
  for (std::size_t k = 0; k < group.plots.size() && group.t.size() > 0; ++k) {
    const Plot& plot = group.plots[k];
    std::string svg = plot.shown ? svg_of(plot, coarse, plot_id(group, k)) : "";
    drawn_any = drawn_any || !svg.empty();
    if (svg.empty() && !live) continue;
    plots.push_back({{"id", plot_id(group, k)},
                     {"joint", plot.joint},
                     {"caption", plot.caption},
                     {"shown", plot.shown},
                     {"svg", std::move(svg)}});
  }
  const bool any = !plots.empty();
  return {{"group", group.id},
          {"any_plot", any},
          {"plots", std::move(plots)},
          {"missing", !drawn_any && !live},
          {"scripts_only", !drawn_any && live}};
}

void add_plot_data(const std::vector<PlotGroup>& groups, json& view) {
  json all = json::array();
  for (const PlotGroup& group : groups)
    if (group.t.size() > 0 && !group.plots.empty()) all.push_back(data_of(group));
  view["live"] = has_page_template("uplot_script") && !all.empty();
  if (view.at("live")) view["plot_data"] = script_escaped(json{{"groups", std::move(all)}}.dump());
}

}  // namespace dynid::detail
