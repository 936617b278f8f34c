// SPDX-License-Identifier: Apache-2.0
// An effect of a joint, a link, a pair or the whole arm that acts in the torques of several joints.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "propose.hpp"

namespace dynid::detail {
namespace {

/// Each unit in its best shape, and what it gains alone.
struct Units {
  std::vector<UnitShape> best;
  std::vector<double> gains;
};

Units best_units(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base, bool refine) {
  Units out{std::vector<UnitShape>(grid.size()), std::vector<double>(grid.size())};
  const auto gain = [&](const RowBlock& block) { return by.coupled_gain(h, block, base); };
  tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t u) {
    const int unit = static_cast<int>(u);
    out.gains[u] = -std::numeric_limits<double>::infinity();
    if (grid[u].points.empty()) return;
    // What a joint does to itself chooses the shape: what it does to the others costs much to compute and
    // adds little.
    const double worth = refine ? by.criteria.worth_refining *
                                      by.price(h, {unit, grid[u].points[0].shape, grid[u].points[0].block})
                                : std::numeric_limits<double>::infinity();
    out.best[u] = h.scope() == Scope::joint && grid[u].points.size() > 1
                      ? best_own_shape(by, h, unit, grid[u], base.channels[u], base.model.kappa, worth)
                      : best_shape(by, h, unit, grid[u].points, gain, worth);
    const bool possible =
        !has(base, h, unit) &&
        (!h.shape_only() || by.plausible(h, unit, Eigen::VectorXd::Ones(1), out.best[u].shape));
    if (possible) out.gains[u] = gain(*out.best[u].block) - by.price(h, out.best[u]);
  });
  return out;
}

/// Gain of some units together.
double total(const Evaluator& by, const Hypothesis& h, const std::vector<UnitShape>& units, const Base& base,
             const Fit& fit) {
  double sum = fit.total - base.model.fit.total;
  for (const UnitShape& u : units) sum -= by.price(h, u);
  return sum;
}

std::vector<Term> terms_of(const Hypothesis& h, const std::vector<UnitShape>& units) {
  std::vector<Term> terms;
  for (const UnitShape& u : units) terms.push_back({u.block.get(), &h});
  return terms;
}

/// Further joints, one after the other, as long as each brings enough.
void add_joints(const Evaluator& by, const Hypothesis& h, const Units& units, std::size_t first,
                const Base& base, Adopted& effect) {
  std::vector<bool> used(units.best.size(), false);
  used[first] = true;
  // What a joint gains alone is near to what it gains beside others: as with shapes, what is far from what it
  // has to bring is not tried.
  for (std::size_t u = 0; u < used.size(); ++u) {
    const double price = std::isfinite(units.gains[u]) ? by.price(h, units.best[u]) : 0.0;
    if (!(units.gains[u] + price >= by.criteria.worth_refining * (price + by.criteria.joint_gain)))
      used[u] = true;
  }
  while (effect.units.size() < units.best.size()) {
    double most = effect.gain + by.criteria.joint_gain;
    std::size_t next = units.best.size();
    for (std::size_t u = 0; u < units.best.size(); ++u) {
      if (used[u]) continue;
      std::vector<UnitShape> more = effect.units;
      more.push_back(units.best[u]);
      const Fit fit = fit_terms(by.rows, base.terms, terms_of(h, more), base.model.kappa);
      const double value = total(by, h, more, base, fit);
      if (value > most) most = value, next = u;
    }
    if (next == units.best.size()) break;
    used[next] = true;
    effect.units.push_back(units.best[next]);
    effect.gain = most;
  }
  std::sort(effect.units.begin(), effect.units.end(),
            [](const UnitShape& a, const UnitShape& b) { return a.unit < b.unit; });
}

/// Without the units whose coefficients no such effect can have.
void keep_plausible(const Evaluator& by, const Hypothesis& h, const Base& base, Adopted& effect) {
  for (bool plausible = h.shape_only(); !plausible && !effect.units.empty();) {
    std::vector<Term> terms = detail::terms_of(base.model.effects);
    for (const Term& more : terms_of(h, effect.units)) terms.push_back(more);
    const Fit fit = fit_terms(by.rows, by.rows.y, terms, base.model.kappa);
    Eigen::Index at = fit.theta.size() - effect.coefficients();
    plausible = true;
    std::vector<UnitShape> kept;
    for (const UnitShape& u : effect.units) {
      if (by.plausible(h, u.unit, fit.theta.segment(at, u.block->size()), u.shape))
        kept.push_back(u);
      else
        plausible = false;
      at += u.block->size();
    }
    effect.units = std::move(kept);
    if (!plausible && !effect.units.empty())
      effect.gain = total(by, h, effect.units, base,
                          fit_terms(by.rows, base.terms, terms_of(h, effect.units), base.model.kappa));
  }
}

}  // namespace

Adopted propose_coupled(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                        bool refine) {
  Adopted effect{&h, {}, 0.0};
  const Units units = best_units(by, h, grid, base, refine);
  const auto first = static_cast<std::size_t>(std::max_element(units.gains.begin(), units.gains.end()) -
                                              units.gains.begin());
  if (!std::isfinite(units.gains[first])) return effect;
  effect.units = {units.best[first]};
  effect.gain = units.gains[first];
  if (h.scope() == Scope::joint) add_joints(by, h, units, first, base, effect);
  keep_plausible(by, h, base, effect);
  return effect;
}

}  // namespace dynid::detail
