// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>

#include "propose.hpp"

namespace dynid::detail {

double improve(const Evaluator& by, const Hypothesis& h, UnitShape& unit, Eigen::Index s, double low,
               double high, bool logarithmic, double best, const Gain& gain) {
  constexpr int most = 10;         // evaluations
  constexpr int settled = 4;       // evaluations after which three alike mean that nothing is to be had
  constexpr double enough = 0.01;  // nats: no judgement hangs on less
  constexpr double near = 0.005;   // of the interval: what is nearer is the same place
  constexpr double golden = 0.381966011250105;
  struct Point {
    double x, gain;
  };
  const Eigen::VectorXd shape = unit.shape;
  if (logarithmic) low = std::log(low), high = std::log(high);
  const double least = near * (high - low);
  // The three best places; while there are fewer, some are the same.
  Point x{logarithmic ? std::log(shape[s]) : shape[s], best}, w = x, v = x;
  double step = 0.0, before = 0.0;  // the last one, and that before it
  bool by_parabola = false;
  for (int k = 0; k < most; ++k) {
    const double middle = 0.5 * (low + high);
    if (std::abs(x.x - middle) <= 2.0 * least - 0.5 * (high - low)) break;
    if (k >= settled && x.gain - std::min(w.gain, v.gain) < enough) break;
    const double d_w = (w.gain - x.gain) / (w.x - x.x), d_v = (v.gain - x.gain) / (v.x - x.x),
                 curvature = (d_w - d_v) / (w.x - v.x), slope = d_w - curvature * (w.x - x.x),
                 to_vertex = -0.5 * slope / curvature;
    const bool vertex = curvature < 0.0 && x.x + to_vertex > low && x.x + to_vertex < high &&
                        std::abs(to_vertex) < 0.5 * std::abs(before);
    if (vertex && by_parabola && 0.5 * slope * to_vertex < enough) break;
    before = vertex ? step : (x.x >= middle ? low : high) - x.x;
    step = vertex ? to_vertex : golden * before;
    if (vertex && std::min(x.x + step - low, high - x.x - step) < 2.0 * least)
      step = std::copysign(least, middle - x.x);  // not onto what is known
    by_parabola = vertex;
    const double at = x.x + (std::abs(step) < least ? std::copysign(least, step) : step);
    Eigen::VectorXd moved = shape;
    moved[s] = logarithmic ? std::exp(at) : at;
    const UnitShape there = by.made(h, unit.unit, moved);
    const Point u{at, gain(*there.block)};
    if (u.gain >= x.gain) {
      (u.x >= x.x ? low : high) = x.x;
      v = w, w = x, x = u;
      unit = there;
    } else {
      (u.x < x.x ? low : high) = u.x;
      if (u.gain >= w.gain || w.x == x.x)
        v = w, w = u;
      else if (u.gain >= v.gain || v.x == x.x || v.x == w.x)
        v = u;
    }
  }
  return x.gain;
}

namespace {

UnitShape refined(const Evaluator& by, const Hypothesis& h, UnitShape unit, const Gain& gain) {
  const std::vector<ShapeParameter> shape = by.rows.shape(h, unit.unit);
  if (shape.empty() || h.scope() == Scope::window) return unit;
  double best = gain(*unit.block);
  for (int pass = 0; pass < (shape.size() > 1 ? 2 : 1); ++pass) {
    for (Eigen::Index s = 0; s < unit.shape.size(); ++s) {
      const ShapeParameter& p = shape[static_cast<std::size_t>(s)];
      if (p.points < 3) continue;
      const double x = unit.shape[s];
      const auto [low, high] = p.beside(x);
      best = improve(by, h, unit, s, low, high, p.logarithmic && !p.both_ways(), best, gain);
    }
  }
  return unit;
}

}  // namespace

UnitShape best_shape(const Evaluator& by, const Hypothesis& h, int unit, const std::vector<GridPoint>& points,
                     const Gain& gain, double worth) {
  double best = -std::numeric_limits<double>::infinity();
  const GridPoint* point = &points.front();
  for (const GridPoint& p : points) {
    const double here = p.shape.size() > 0 ? gain(*p.block) : 0.0;
    if (here > best) best = here, point = &p;
  }
  const UnitShape unit_shape{unit, point->shape, point->block};
  return point->shape.size() > 0 && best < worth ? unit_shape : refined(by, h, unit_shape, gain);
}

std::vector<GridPoint> nearest_of(const Evaluator& by, const Hypothesis& h, int joint, const UnitGrid& grid,
                                  const Channel& channel) {
  if (grid.points.size() <= nearest_points) return grid.points;
  std::vector<double> gains;
  if (grid.screen != nullptr)
    gains = grid.screen->gains(by.rows, joint, channel.by);
  else
    for (const GridPoint& point : grid.points)
      gains.push_back(quick_gain(by.rows, joint, {point.block.get(), &h}, channel.by));
  std::vector<std::pair<double, std::size_t>> quick;
  for (std::size_t k = 0; k < gains.size(); ++k) quick.emplace_back(-gains[k], k);
  std::partial_sort(quick.begin(), quick.begin() + nearest_points, quick.end());
  std::vector<GridPoint> best;
  for (std::size_t k = 0; k < nearest_points; ++k) best.push_back(grid.points[quick[k].second]);
  return best;
}

UnitShape best_own_shape(const Evaluator& by, const Hypothesis& h, int joint, const UnitGrid& grid,
                         const Channel& channel, double kappa, double worth) {
  const auto own = [&](const RowBlock& block) { return by.own_gain(h, joint, block, channel, kappa); };
  return best_shape(by, h, joint, nearest_of(by, h, joint, grid, channel), own, worth);
}

}  // namespace dynid::detail
