// SPDX-License-Identifier: Apache-2.0
#include "propose.hpp"

#include <algorithm>
#include <utility>

namespace dynid::detail {
namespace {

constexpr std::size_t nearest_units = 2;  // by each noise, of links and pairs: one will be taken

/// Half of what the coefficients of normal equations [G | h] take.
double gain_of(const Eigen::MatrixXd& normal) {
  const Eigen::Index p = normal.rows();
  const Eigen::VectorXd h = normal.col(p);
  return 0.5 * h.dot(solve(normal.leftCols(p), h, nullptr));
}

/// Units without a shape of their own, of which one will be taken: the best by what each gains if the noise
/// is a matter of size alone.
std::vector<bool> best_alone(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base) {
  std::vector<std::vector<std::pair<double, std::size_t>>> gains(base.terms.by.size());
  for (std::size_t u = 0; u < grid.size(); ++u) {
    if (has(base, h, static_cast<int>(u))) continue;
    const RowBlock& block = *grid[u].points.front().block;
    const std::vector<Eigen::MatrixXd> normals = normal_equations_beside(by.rows, base.terms, block);
    for (std::size_t k = 0; k < normals.size(); ++k) gains[k].emplace_back(-gain_of(normals[k]), u);
  }
  std::vector<bool> out(grid.size(), false);
  for (auto& here : gains) {
    const std::size_t few = std::min(nearest_units, here.size());
    std::partial_sort(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(few), here.end());
    for (std::size_t k = 0; k < few; ++k) out[here[k].second] = true;
  }
  return out;
}

}  // namespace

bool has(const Base& base, const Hypothesis& h, int unit) {
  return std::any_of(base.model.effects.begin(), base.model.effects.end(),
                     [&](const Adopted& e) { return e.h == &h && e.units.front().unit == unit; });
}

UnitGrid unit_grid(const GapRows& rows, const Hypothesis& h, int unit, std::vector<GridPoint> points) {
  UnitGrid out{std::move(points), nullptr};
  if (h.scope() != Scope::joint || h.shape_only() || out.points.size() <= nearest_points) return out;
  std::vector<const RowBlock*> blocks;
  for (const GridPoint& point : out.points) {
    if (point.block->find(unit) == nullptr) return out;
    blocks.push_back(point.block.get());
  }
  out.screen = std::make_shared<Screen>(rows, unit, blocks);
  return out;
}

Grid nearest(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base) {
  if (h.scope() == Scope::joint) {
    Grid out(grid.size());
    for (std::size_t u = 0; u < grid.size(); ++u)
      out[u] = {nearest_of(by, h, static_cast<int>(u), grid[u], base.channels[u]), nullptr};
    return out;
  }
  Grid out = grid;
  const bool shaped =
      std::any_of(grid.begin(), grid.end(), [](const UnitGrid& unit) { return unit.points.size() > 1; });
  if (shaped || h.shape_only() || grid.size() <= nearest_units * base.terms.by.size()) return out;
  const std::vector<bool> best = best_alone(by, h, grid, base);
  for (std::size_t u = 0; u < grid.size(); ++u)
    if (!best[u]) out[u].points.clear();
  return out;
}

Adopted propose(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base, bool refine,
                double worth) {
  if (grid.empty()) return {&h, {}, 0.0};  // a pair, of a robot with one joint
  if (h.scope() == Scope::window) return propose_window(by, h, grid, base, worth);
  // A link or a pair that does not come near has no points.
  if (h.scope() == Scope::joint && own_channel(h, *grid[0].points[0].block))
    return propose_own(by, h, grid, base, refine);
  return propose_coupled(by, h, grid, base, refine);
}

}  // namespace dynid::detail
