// SPDX-License-Identifier: Apache-2.0
#include "gap_model.hpp"

#include <algorithm>

namespace dynid::detail {

Eigen::Index Adopted::coefficients() const {
  Eigen::Index size = 0;
  for (const UnitShape& u : units) size += h->shape_only() ? 0 : u.block->size();
  return size;
}

bool own_channel(const Hypothesis& h, const RowBlock& block) {
  return h.scope() == Scope::joint && block.channels.size() == 1;
}

std::vector<Term> terms_of(const std::vector<Adopted>& effects) {
  std::vector<Term> terms;
  for (const Adopted& e : effects)
    for (const UnitShape& u : e.units) terms.push_back({u.block.get(), e.h});
  return terms;
}

bool has_window(const GapModel& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Adopted& e) { return e.h->scope() == Scope::window; });
}

bool has_once(const GapModel& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Adopted& e) { return e.h->once(); });
}

Eigen::VectorXd lateness(const GapModel& model, int joints) {
  Eigen::VectorXd late = Eigen::VectorXd::Zero(joints);
  for (const Adopted& e : model.effects)
    for (const UnitShape& u : e.units)
      for (const int j : u.block->channels) late[j] += e.h->lateness(u.shape);
  return late;
}

std::vector<Adopted> without(const std::vector<Adopted>& effects, std::size_t which) {
  std::vector<Adopted> others = effects;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(which));
  return others;
}

std::vector<Adopted> carried(const GapRows& rows, const std::vector<Adopted>& effects) {
  std::vector<Adopted> out = effects;
  for (Adopted& e : out)
    for (UnitShape& u : e.units) u.block = std::make_shared<RowBlock>(rows.block(*e.h, u.unit, u.shape));
  return out;
}

Fit fit_of(const GapRows& rows, const std::vector<Adopted>& effects, double kappa) {
  return fit_terms(rows, rows.y, terms_of(effects), kappa);
}

Eigen::MatrixXd own_contribution(const GapModel& model, std::size_t which) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(model.fit.left.rows(), model.fit.left.cols());
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < which; ++k) at += model.effects[k].coefficients();
  const Adopted& e = model.effects[which];
  for (const UnitShape& u : e.units) {
    const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
    for (std::size_t i = 0; i < u.block->channels.size(); ++i)
      sum.col(u.block->channels[i]) +=
          p > 0 ? Eigen::VectorXd(u.block->values[i] * model.fit.theta.segment(at, p))
                : Eigen::VectorXd(u.block->values[i].rowwise().sum());
    at += p;
  }
  return sum;
}

Eigen::MatrixXd contribution(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& theta,
                             std::ptrdiff_t only) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(rows.size(), rows.joints());
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    const Adopted& e = model.effects[k];
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      if (only < 0 || only == static_cast<std::ptrdiff_t>(k)) {
        const RowBlock block = rows.block(*e.h, u.unit, u.shape);
        for (std::size_t i = 0; i < block.channels.size(); ++i)
          sum.col(block.channels[i]) += p > 0 ? Eigen::VectorXd(block.values[i] * theta.segment(at, p))
                                              : Eigen::VectorXd(block.values[i].rowwise().sum());
      }
      at += p;
    }
  }
  return sum;
}

}  // namespace dynid::detail
