// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "search.hpp"

namespace dynid::detail {
namespace {

constexpr double least_simpler = 1.0;  // nat: what a simpler form saves of the price, and no rounding
constexpr double nearly = 1e-3;        // of a column's energy: what the steps of a grid leave

/// What `simple` adds to a joint's torque is what `general` can add to it as well.
bool contains(const RowBlock& general, const RowBlock& simple) {
  const Eigen::MatrixXd &g = general.values[0], &s = simple.values[0];
  Eigen::MatrixXd G = g.transpose() * g;
  G.diagonal() *= 1.0 + 1e-12;
  return (s - g * G.ldlt().solve(g.transpose() * s)).squaredNorm() < nearly * s.squaredNorm();
}

/// The effects of a model that one joint has, and in which form.
struct Decided {
  std::vector<UnitShape> units;
  std::vector<std::size_t> owners;  // of the model's effects
};

/// Of all subsets of the forms, the one that the joint's evidence asks for.
Decided decide(const Evaluator& by, const GapModel& model, const std::vector<std::size_t>& own,
               const std::vector<UnitShape>& forms, int joint, const Channel& alone) {
  // Every subset is fitted by the same noises: white, and that of all forms together.
  Eigen::MatrixXd columns(by.rows.size(), 0), every(by.rows.size(), 0);
  Eigen::VectorXd gap = alone.y;
  std::vector<std::vector<Eigen::Index>> where(own.size());
  for (std::size_t i = 0; i < own.size(); ++i) {
    const Eigen::MatrixXd& values = forms[i].block->values[0];
    const bool fixed = model.effects[own[i]].h->shape_only();
    const Eigen::MatrixXd mine = fixed ? Eigen::MatrixXd(values.rowwise().sum()) : values;
    for (Eigen::Index k = 0; k < mine.cols(); ++k) where[i].push_back(columns.cols() + k);
    columns = beside(columns, mine);
    if (fixed)
      gap -= mine;
    else
      every = beside(every, mine);
  }
  std::vector<SeenChannel> base;
  for (const ChannelNoise& noise :
       {white(alone.y), fit_channel(by.rows, joint, gap, every, model.kappa).noise})
    base.push_back(seen(by.rows, alone.y, columns, whitener(by.rows, joint, noise, model.kappa)));

  Decided out;
  double most = -std::numeric_limits<double>::infinity();
  const std::size_t subsets = std::size_t{1} << own.size();
  for (std::size_t subset = 0; subset < subsets; ++subset) {
    std::vector<Eigen::Index> free, fixed;
    double value = 0.0;
    Decided here;
    for (std::size_t i = 0; i < own.size(); ++i) {
      if ((subset >> i & 1U) == 0) continue;
      const Hypothesis& h = *model.effects[own[i]].h;
      std::vector<Eigen::Index>& into = h.shape_only() ? fixed : free;
      into.insert(into.end(), where[i].begin(), where[i].end());
      value -= by.price(h, forms[i]) + by.criteria.joint_gain;
      here.units.push_back(forms[i]);
      here.owners.push_back(own[i]);
    }
    const ChannelFit fit = fit_subset(by.rows, joint, alone.y, columns, free, fixed, model.kappa, base);
    Eigen::Index at = 0;
    bool plausible = true;
    for (std::size_t i = 0; i < here.units.size(); ++i) {
      const Hypothesis& h = *model.effects[here.owners[i]].h;
      const Eigen::Index p = h.shape_only() ? 0 : here.units[i].block->size();
      if (p > 0)
        plausible = plausible && by.plausible(h, joint, fit.theta.segment(at, p), here.units[i].shape);
      at += p;
    }
    value += fit.evidence;
    if (plausible && value > most) most = value, out = std::move(here);
  }
  return out;
}

}  // namespace

std::vector<UnitShape> Search::forms_on(const GapModel& model, const std::vector<std::size_t>& own, int joint,
                                        const Channel& alone) const {
  std::vector<UnitShape> forms(own.size());
  std::vector<bool> found(own.size(), false);
  for (std::size_t i = 0; i < own.size(); ++i)
    for (const UnitShape& u : model.effects[own[i]].units)
      if (u.unit == joint && !found[i]) forms[i] = u, found[i] = true;
  if (std::none_of(found.begin(), found.end(), [](bool x) { return x; })) return {};
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (found[i]) continue;
    const Hypothesis& h = *model.effects[own[i]].h;
    const auto which = std::find(library_.begin(), library_.end(), &h) - library_.begin();
    const UnitGrid& grid = grids_[static_cast<std::size_t>(which)][static_cast<std::size_t>(joint)];
    const double worth =
        by_.criteria.worth_refining *
        (by_.price(h, {joint, grid.points[0].shape, grid.points[0].block}) + by_.criteria.joint_gain);
    forms[i] = best_own_shape(by_, h, joint, grid, alone, model.kappa, worth);
  }
  return forms;
}

GapModel Search::simplified(GapModel model) const {
  if (proposer_ != nullptr) return model;
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    const Adopted general = model.effects[k];
    const RowBlock& block = *general.units.front().block;
    if (general.h->shape_only() || block.size() < 2 || !own_channel(*general.h, block)) continue;
    for (std::size_t l = 0; l < library_.size(); ++l) {
      const Hypothesis& simple = *library_[l];
      const bool there = std::any_of(model.effects.begin(), model.effects.end(),
                                     [&](const Adopted& e) { return e.h->name() == simple.name(); });
      if (there || simple.scope() != Scope::joint || simple.shape_only() || grids_[l].empty()) continue;
      if (const RowBlock& first = *grids_[l][0].points[0].block;
          first.size() >= block.size() || !own_channel(simple, first))
        continue;
      std::vector<Adopted> effects = model.effects;
      effects.push_back({&simple, {}, 0.0});
      for (const UnitShape& u : general.units) {
        const Channel alone = by_.channel_of(model, u.unit, false);
        effects.back().units.push_back(best_own_shape(
            by_, simple, u.unit, grids_[l][static_cast<std::size_t>(u.unit)], alone, model.kappa));
      }
      if (!contains(block, *effects.back().units.front().block)) continue;
      const GapModel both = reassigned(evaluate(std::move(effects), model.kappa));
      if (both.score > model.score + least_simpler && by_.plausible(both)) model = both;
    }
  }
  return model;
}

GapModel Search::reshaped(const GapModel& model) const {
  const auto own = [](const Adopted& e) { return own_channel(*e.h, *e.units.front().block); };
  const Adopted& newest = model.effects.back();
  if (!own(newest)) return model;
  std::vector<Adopted> effects = model.effects;
  for (std::size_t k = 0; k + 1 < effects.size(); ++k) {
    const Hypothesis& h = *effects[k].h;
    if (h.shape_only() || effects[k].units.front().shape.size() == 0 || !own(effects[k])) continue;
    const auto which =
        static_cast<std::size_t>(std::find(library_.begin(), library_.end(), &h) - library_.begin());
    for (UnitShape& u : effects[k].units) {
      const auto same_joint = [&](const UnitShape& other) { return other.unit == u.unit; };
      if (std::none_of(newest.units.begin(), newest.units.end(), same_joint)) continue;
      const Channel rest = by_.channel_of(model, u.unit, true, &h);
      u = best_own_shape(by_, h, u.unit, grids_[which][static_cast<std::size_t>(u.unit)], rest, model.kappa);
    }
  }
  GapModel better = evaluate(std::move(effects), model.kappa);
  return better.score > model.score && by_.plausible(better) ? better : model;
}

GapModel Search::reassigned(const GapModel& model) const {
  std::vector<std::size_t> own;  // of the model's effects
  for (std::size_t k = 0; k < model.effects.size(); ++k)
    if (own_channel(*model.effects[k].h, *model.effects[k].units.front().block)) own.push_back(k);
  if (own.size() < 2) return model;
  std::vector<Adopted> effects = model.effects;
  for (const std::size_t k : own) effects[k].units.clear();
  for (int j = 0; j < by_.rows.joints(); ++j) {
    const Channel alone = by_.channel_of(model, j, false);
    const std::vector<UnitShape> forms = forms_on(model, own, j, alone);
    if (forms.empty()) continue;
    const Decided decided = decide(by_, model, own, forms, j, alone);
    for (std::size_t i = 0; i < decided.units.size(); ++i)
      effects[decided.owners[i]].units.push_back(decided.units[i]);
  }
  effects.erase(
      std::remove_if(effects.begin(), effects.end(), [](const Adopted& e) { return e.units.empty(); }),
      effects.end());
  if (effects.empty() || effects.back().h != model.effects.back().h) return model;  // the newest has to stay
  GapModel better = evaluate(std::move(effects), model.kappa);
  return better.score > model.score && by_.plausible(better) ? better : model;
}

}  // namespace dynid::detail
