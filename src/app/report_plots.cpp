// SPDX-License-Identifier: Apache-2.0
#include "report_plots.hpp"

#include <algorithm>
#include <cmath>

#include "report_words.hpp"

namespace dynid::detail {
namespace {

constexpr Eigen::Index plot_width = 800, replay_width = 400;  // [px]: of a plot on a wide screen, half of it
constexpr double gap_in_time = 0.2;                           // [s]: a line is not drawn across
constexpr double replay_shown = 6.0;                          // [s]
constexpr std::size_t most_plots = 4, most_replayed = 2;

bool is_shown(const std::vector<std::size_t>& order, std::size_t joint, std::size_t most) {
  const auto end = order.begin() + static_cast<std::ptrdiff_t>(std::min(most, order.size()));
  return std::find(order.begin(), end, joint) != end;
}

double rms(const Eigen::VectorXd& x) { return std::sqrt(x.squaredNorm() / static_cast<double>(x.size())); }

}  // namespace

PlotGroup gap_plots(const Diagnosis& d, const std::vector<std::size_t>& order, int log) {
  const GapSeries& s = d.series;
  const Eigen::Index n = s.before.cols();
  std::vector<Eigen::Index> rows;
  std::vector<bool> fresh;
  bool all_held = true;
  std::vector<std::pair<double, double>> held;
  bool was_held = false;
  for (Eigen::Index i = 0; i < s.t.size(); ++i) {
    if (s.log[static_cast<std::size_t>(i)] != log) continue;
    fresh.push_back(!rows.empty() && s.t[i] - s.t[rows.back()] > gap_in_time);
    rows.push_back(i);
    const bool is_held = s.held_out[static_cast<std::size_t>(i)];
    if (is_held && (!was_held || fresh.back())) held.emplace_back(s.t[i], s.t[i]);
    if (is_held) held.back().second = s.t[i];
    was_held = is_held;
    all_held = all_held && is_held;
  }
  if (rows.empty()) return {};
  Eigen::MatrixXd columns(static_cast<Eigen::Index>(rows.size()), 2 * n);
  columns << s.before(rows, Eigen::all), s.after(rows, Eigen::all);
  PlotGroup group = thinned(s.t(rows), columns, fresh, plot_width);
  group.id = "residual";
  if (!all_held) group.shaded = std::move(held);
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const std::string unit = d.unit.empty() ? "N m" : d.unit[k], joint = std::to_string(j + 1);
    const double reach = std::max({3.0 * d.floor[j], 1.08 * columns.col(j).cwiseAbs().maxCoeff(),
                                   1.08 * columns.col(n + j).cwiseAbs().maxCoeff(), 1e-9});
    Plot plot;
    plot.joint = static_cast<int>(j) + 1;
    plot.caption = "Joint " + joint;
    plot.label = "Gap of joint " + joint + " over time: " + page_number(rms(columns.col(j))) + " " + unit +
                 " rms with the nominal model, " + page_number(rms(columns.col(n + j))) +
                 " with the effects, " + page_number(d.floor[j]) + " of noise.";
    plot.axis = "gap [" + unit + "]";
    plot.shown = is_shown(order, k, most_plots);
    plot.low = -reach;
    plot.high = reach;
    plot.band = 2.0 * d.floor[j];
    const int column = static_cast<int>(j);
    plot.lines = {{"nominal model", "--before", column},
                  {"with the effects", "--after", static_cast<int>(n) + column}};
    group.plots.push_back(std::move(plot));
  }
  return group;
}

PlotGroup replay_plots(const Rollout& r, const std::vector<std::size_t>& order) {
  const Eigen::Index n = r.q.cols();
  Eigen::Index rows = 0;
  std::vector<bool> fresh;
  for (; rows < r.t.size() && r.t[rows] < r.t[0] + replay_shown; ++rows)
    fresh.push_back(rows > 0 && r.start[rows] != r.start[rows - 1]);
  if (rows == 0) return {};
  Eigen::MatrixXd columns(rows, 3 * n);
  columns << r.q.topRows(rows), r.without.topRows(rows), r.with.topRows(rows);
  PlotGroup group = thinned(r.t.head(rows), columns, fresh, replay_width);
  group.id = "replay";
  for (const bool error : {false, true})
    for (Eigen::Index j = 0; j < n; ++j) {
      const std::string joint = std::to_string(j + 1);
      const auto off = [&](Eigen::Index of) {
        return 1e3 * (columns.col(of * n + j) - columns.col(j)).cwiseAbs().maxCoeff();
      };
      Plot plot;
      plot.joint = static_cast<int>(j) + 1;
      plot.caption = "Joint " + joint + (error ? ", error of the replay" : ", position");
      plot.label = (error ? "Error of the replayed position of joint " : "Replayed position of joint ") +
                   joint + ": off by at most " + page_number(off(1)) + " mrad with the nominal model, " +
                   page_number(off(2)) + " with the effects.";
      plot.axis = error ? "error [mrad]" : "position [rad]";
      plot.shown = is_shown(order, static_cast<std::size_t>(j), most_replayed);
      const int q = static_cast<int>(j), without = static_cast<int>(n) + q,
                with = static_cast<int>(2 * n) + q;
      if (error) {
        plot.logarithmic = true;
        plot.low = 0.01;
        plot.high =
            std::pow(10.0, std::clamp(std::ceil(std::log10(std::max({off(1), off(2), 0.1}))), -1.0, 6.0));
        plot.lines = {{"nominal model", "--before", without, q}, {"with the effects", "--after", with, q}};
      } else {
        const double low = columns.col(j).minCoeff(), high = columns.col(j).maxCoeff(),
                     room = 0.5 * std::max(high - low, 0.02);
        plot.low = low - room;
        plot.high = high + room;
        plot.lines = {{"measured", "--floor", q, -1, 4.0},
                      {"nominal model", "--before", without},
                      {"with the effects", "--after", with}};
      }
      group.plots.push_back(std::move(plot));
    }
  return group;
}

}  // namespace dynid::detail
