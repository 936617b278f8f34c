// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>

#include "propose.hpp"

namespace dynid::detail {

double improve(const Evaluator& by, const Hypothesis& h, UnitShape& unit, Eigen::Index s, double low,
               double high, bool logarithmic, double best, const Gain& gain) {
  const auto to = [&](double x) { return logarithmic ? std::log(x) : x; };
  const Eigen::VectorXd shape = unit.shape;
  const auto value = [&](double x, UnitShape& out) {
    Eigen::VectorXd at = shape;
    at[s] = logarithmic ? std::exp(x) : x;
    out = by.made(h, unit.unit, at);
    return gain(*out.block);
  };
  low = to(low), high = to(high);
  constexpr int settled = 4;            // steps after which the two points are near each other
  constexpr double enough = 0.01;       // nats: no judgement hangs on less
  const double g = 0.6180339887498949;  // golden section
  double a = high - g * (high - low), b = low + g * (high - low);
  UnitShape at_a, at_b;
  double fa = value(a, at_a), fb = value(b, at_b);
  for (int k = 0; k < 10; ++k) {
    if (k >= settled && std::abs(fa - fb) < enough) break;
    if (fa > fb) {
      high = b, b = a, fb = fa, at_b = at_a;
      a = high - g * (high - low);
      fa = value(a, at_a);
    } else {
      low = a, a = b, fa = fb, at_a = at_b;
      b = low + g * (high - low);
      fb = value(b, at_b);
    }
  }
  if (fa > best) best = fa, unit = at_a;
  if (fb > best) best = fb, unit = at_b;
  return best;
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
      if (p.logarithmic) {
        const double step = std::pow(p.high / p.low, 1.0 / (p.points - 1));
        best =
            improve(by, h, unit, s, std::max(p.low, x / step), std::min(p.high, x * step), true, best, gain);
      } else {
        const double step = (p.high - p.low) / (p.points - 1);
        best =
            improve(by, h, unit, s, std::max(p.low, x - step), std::min(p.high, x + step), false, best, gain);
      }
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
