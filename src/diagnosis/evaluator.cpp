// SPDX-License-Identifier: Apache-2.0
#include "evaluator.hpp"

#include <tbb/parallel_for.h>

#include <cmath>
#include <utility>

namespace dynid::detail {

Eigen::MatrixXd beside(const Eigen::MatrixXd& left, const Eigen::MatrixXd& right) {
  Eigen::MatrixXd both(right.rows(), left.cols() + right.cols());
  both << left, right;
  return both;
}

std::shared_ptr<const RowBlock> BlockMemo::of(const GapRows& rows, const Hypothesis& h, int unit,
                                              const Eigen::VectorXd& shape) {
  constexpr Eigen::Index most_numbers = 12'000'000;  // 96 MB
  // A window hardly ever ends where another one did, and its columns are many.
  if (h.scope() == Scope::window) return std::make_shared<const RowBlock>(rows.block(h, unit, shape));
  Key key(&h, unit, std::vector<double>(shape.data(), shape.data() + shape.size()));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (const auto found = made_.find(key); found != made_.end()) return found->second;
  }
  auto block = std::make_shared<const RowBlock>(rows.block(h, unit, shape));
  Eigen::Index numbers = 0;
  for (const Eigen::MatrixXd& values : block->values) numbers += values.size();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (numbers_ + numbers > most_numbers) {
    made_.clear();
    numbers_ = 0;
  }
  if (made_.emplace(std::move(key), block).second) numbers_ += numbers;
  return block;
}

double Evaluator::cost(const Adopted& effect) const {
  double cost = -criteria.prior_weight * std::log(effect.h->prior(robot()));
  for (const UnitShape& unit : effect.units) cost += price(*effect.h, unit);
  if (effect.h->scope() == Scope::window) cost += 2.0 * std::log(double(rows.size()));
  return cost;
}

double Evaluator::price(const Hypothesis& h, const UnitShape& unit) const {
  const double coefficients = h.shape_only() ? 0.0 : double(unit.block->directions);
  return (0.5 * std::log(double(rows.size())) + 1.5) * (coefficients + double(unit.shape.size())) +
         (h.scope() == Scope::arm ? 0.0 : std::log(double(rows.joints())));
}

bool Evaluator::plausible(const GapModel& model) const {
  Eigen::Index at = 0;
  for (const Adopted& e : model.effects) {
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      const Eigen::VectorXd c =
          p > 0 ? Eigen::VectorXd(model.fit.theta.segment(at, p)) : Eigen::VectorXd::Ones(1);
      if (!plausible(*e.h, u.unit, c, u.shape)) return false;
      at += p;
    }
  }
  return true;
}

GapModel Evaluator::evaluate(std::vector<Adopted> effects, double kappa) const {
  GapModel model;
  model.fit = fit_terms(rows, rows.y, terms_of(effects), kappa);
  model.score = model.fit.total;
  Eigen::Index at = 0;
  for (const Adopted& e : effects) {
    model.score -= cost(e);
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      if (p > 0)
        model.score -= criteria.prior_weight * e.h->surprise(robot(), u.unit, model.fit.theta.segment(at, p));
      at += p;
    }
  }
  model.effects = std::move(effects);
  model.kappa = kappa;
  return model;
}

UnitShape Evaluator::made(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const {
  return {unit, shape, memo_->of(rows, h, unit, shape)};
}

std::vector<Adopted> Evaluator::here(std::vector<Adopted> effects) const {
  for (Adopted& e : effects)
    for (UnitShape& u : e.units) u = made(*e.h, u.unit, u.shape);
  return effects;
}

Channel Evaluator::channel_of(const GapModel& model, int joint, bool keep_own,
                              const Hypothesis* without) const {
  Channel out{model.fit.left.col(joint), Eigen::MatrixXd(rows.size(), 0), 0.0, {}};
  Eigen::Index at = 0;
  for (const Adopted& e : model.effects) {
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      if (own_channel(*e.h, *u.block) && u.block->channels[0] == joint) {
        const Eigen::MatrixXd& values = u.block->values[0];
        const bool kept = keep_own && e.h != without;
        if (p > 0) out.y += values * model.fit.theta.segment(at, p);
        if (p > 0 && kept) out.columns = beside(out.columns, values);
        if (p == 0 && !kept) out.y += values.rowwise().sum();
      }
      at += p;
    }
  }
  const ChannelFit fit = fit_channel(rows, joint, out.y, out.columns, model.kappa);
  out.evidence = fit.evidence;
  for (const ChannelNoise& noise : {white(out.y), fit.noise})
    out.by.push_back(seen(rows, out.y, out.columns, whitener(rows, joint, noise, model.kappa)));
  return out;
}

Base Evaluator::base_of(const GapModel& model) const {
  const auto n = static_cast<std::size_t>(rows.joints());
  Base base{model, std::vector<Channel>(n), {}};
  std::vector<std::vector<Whitener>> by(2, std::vector<Whitener>(n));
  tbb::parallel_for(0, rows.joints(), [&](int j) {
    const auto at = static_cast<std::size_t>(j);
    base.channels[at] = channel_of(model, j, true);
    by[0][at] = whitener(rows, j, white(rows.y.col(j)), model.kappa);
    by[1][at] = whitener(rows, j, model.fit.noise[at], model.kappa);
  });
  base.terms = seen(rows, terms_of(model.effects), by);
  return base;
}

double Evaluator::own_gain(const Hypothesis& h, int joint, const RowBlock& block, const Channel& channel,
                           double kappa) const {
  return fit_channel(rows, joint, channel.y, channel.columns, {&block, &h}, kappa, channel.by).evidence -
         channel.evidence;
}

double Evaluator::coupled_gain(const Hypothesis& h, const RowBlock& block, const Base& base) const {
  return fit_terms(rows, base.terms, {{&block, &h}}, base.model.kappa).total - base.model.fit.total;
}

}  // namespace dynid::detail
