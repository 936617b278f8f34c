// SPDX-License-Identifier: Apache-2.0
#include "rank.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "dynid/diagnosis/calibration.hpp"
#include "energy.hpp"
#include "grounds.hpp"

namespace dynid::detail {
namespace {

constexpr double least_unlike = 1e-4;  // less of its energy is nothing

double form_of(const Criteria& criteria, const Hypothesis& h) {
  return h.approximate() ? criteria.form_of_approximate : criteria.form_of_exact;
}

/// Part of the gap's energy beyond the floor that an effect takes alone.
double explained_alone(const Choice& choice, const GapModel& model, const Eigen::VectorXd& floor) {
  const GapModel alone =
      model.effects.size() == 1 ? model : choice.search.evaluate({model.effects.back()}, model.kappa);
  return std::clamp(shrink_fraction(choice.rows.y, alone.fit.residual, floor), 0.0, 1.0);
}

struct Candidate {
  double score, explained;
  double left;                      // energy, in units of the floor
  double cost = 0.0;                // of the effects
  const GapModel* model = nullptr;  // among `others`; null: nothing there
};

/// Energy of each joint where a torque acts, in units of the floor; 0 elsewhere.
Eigen::RowVectorXd energy_where(const Eigen::MatrixXd& torque, const Eigen::MatrixXd& x,
                                const Eigen::VectorXd& floor) {
  const Eigen::RowVectorXd all = rms(x).cwiseQuotient(floor).array().square().transpose();
  return (torque.colwise().squaredNorm().array() > 0.0).select(all, 0.0);
}

/// The prices of its effects, and how common they are: not how large they were found, of which data that do
/// not tell two effects apart say nothing.
double cost_of(const Choice& choice, const GapModel& model) {
  double cost = 0.0;
  for (const Adopted& e : model.effects) cost += choice.search.cost(e);
  return cost;
}

/// A set's score, the form errors of its effects being noise.
double score_of(const Choice& choice, const GapModel& m, const FormError& form) {
  return m.score - m.fit.total + evidence_with_form(choice.rows, m.fit, form.size, form.innovation);
}

/// The base with one more wrong link, for each that may be: the search proposes the best of them alone, but
/// it is another that may stand in the place of an effect.
std::vector<GapModel> with_another_link(const Choice& choice, const GapModel& base) {
  std::vector<GapModel> out;
  std::set<const Hypothesis*> seen;
  for (const Adopted& e : base.effects) {
    if (e.h->scope() != Scope::link || !seen.insert(e.h).second) continue;
    for (int unit = 0; unit < e.h->units(choice.search.robot()); ++unit) {
      const auto there = [&](const Adopted& other) {
        return other.h == e.h && other.units.front().unit == unit;
      };
      if (std::any_of(base.effects.begin(), base.effects.end(), there)) continue;
      std::vector<Adopted> effects = base.effects;
      effects.push_back({e.h, {{unit, {}, nullptr}}, 0.0});
      out.push_back(choice.search.moved_here(effects, base.kappa));
    }
  }
  return out;
}

/// Scores in the place of one effect; "" is nothing there.
std::map<std::string, Candidate> candidates(const Choice& choice, const GapModel& base, const FormError& form,
                                            const Eigen::VectorXd& floor, bool explained,
                                            std::vector<GapModel>& others) {
  const auto score = [&](const GapModel& m) { return score_of(choice, m, form); };
  const auto left = [&](const GapModel& m) { return energy(m.fit.residual, floor); };
  std::map<std::string, Candidate> out = {{"", {score(base), 0.0, left(base)}}};
  others = choice.search.alternatives(base, 8);
  for (GapModel& wider : with_another_link(choice, base)) others.push_back(std::move(wider));
  for (const GapModel& m : others) {
    const Candidate here{score(m), explained ? explained_alone(choice, m, floor) : 0.0, left(m),
                         cost_of(choice, m), &m};
    Candidate& best = out.emplace(m.effects.back().h->name(), here).first->second;
    if (here.score > best.score) best = here;
  }
  return out;
}

}  // namespace

std::vector<std::size_t> by_share(const std::vector<double>& shares) {
  std::vector<std::size_t> order(shares.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return shares[a] > shares[b]; });
  return order;
}

double needed(const Choice& choice, const GapModel& model, std::size_t which, const Calibration& by) {
  const FormError form = form_error(choice, model, which);
  const GapModel base = choice.search.evaluate(without(model.effects, which), model.kappa);
  return 1.0 /
         (1.0 + std::exp((score_of(choice, base, form) - score_of(choice, model, form)) / by.temperature));
}

bool below_form(const Choice& choice, const GapModel& model, std::size_t which) {
  const FormError form = form_error(choice, model, which);
  const Eigen::MatrixXd torque = own_contribution(model, which);
  for (Eigen::Index j = 0; j < torque.cols(); ++j)
    if (torque.col(j).squaredNorm() > form.size[j] * double(torque.rows())) return false;
  return true;
}

Ranked rank(const Choice& choice, const GapModel& model, const std::vector<double>& shares,
            const Eigen::VectorXd& floor, const Calibration& by) {
  const std::size_t count = model.effects.size();
  Ranked out{std::vector<double>(count),
             std::vector<double>(count),
             std::vector<std::vector<std::string>>(count),
             {},
             grounds_of(choice, model, shares, floor),
             {}};
  std::map<std::string, RankedEffect> ranking;
  for (const std::string& name : choice.search.names()) ranking[name].name = name;
  // `certain` is of the candidate on top; the others share what is left of it as their scores say.
  const auto put_first = [&](const std::map<std::string, Candidate>& all, double top, double certain) {
    double sum = 0.0;
    for (const auto& [name, c] : all) sum += std::exp((c.score - top) / by.temperature);
    for (const auto& [name, c] : all) {
      const double part = std::exp((c.score - top) / by.temperature) / sum;
      if (!name.empty())
        ranking[name] = {name, c.score == top ? certain : (1.0 - certain) * part, c.explained};
    }
  };
  const std::vector<std::size_t> order = by_share(shares);
  const FormError form = form_error(choice, model);
  const double own = score_of(choice, model, form);
  std::vector<std::map<std::string, Candidate>> instead(count);
  std::vector<std::vector<GapModel>> others(count);  // that those are of
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t k) {
    instead[k] = candidates(choice, choice.search.evaluate(without(model.effects, k), model.kappa), form,
                            floor, k == order.front(), others[k]);
  });
  for (const std::size_t k : order) {
    const std::string mine = model.effects[k].h->name();
    std::map<std::string, Candidate>& all = instead[k];
    all.erase(mine);
    // What is as good shares the probability; what is not is what it is measured against. As good is what
    // the evidence does not tell from it, and what leaves no more than its own form can be blamed for: of
    // that the price alone counts.
    const double indistinct = choice.criteria().indistinct, mine_left = energy(model.fit.residual, floor),
                 mine_cost = cost_of(choice, model);
    const Eigen::MatrixXd torque = own_contribution(model, k);
    const double size = energy(torque, floor) + 1e-300,
                 mine_here = energy_where(torque, model.fit.residual, floor).sum();
    double best = -std::numeric_limits<double>::infinity(), left = best, alike = 1.0, least_behind = 0.0;
    const GapModel* rival = nullptr;
    for (const auto& [name, c] : all) {
      double behind = (own - c.score) / by.temperature;
      bool as_good = false;
      if (c.model != nullptr) {
        const double part = form_of(choice.criteria(), *c.model->effects.back().h);
        // Of all joints, and of those where the effect acts: what another takes elsewhere does not make it as
        // good here.
        const double here = energy_where(torque, c.model->fit.residual, floor).sum(),
                     more = std::max(here - mine_here, c.left - mine_left);
        const bool by_form = more < part * part * size;
        if (by_form) behind = std::min(behind, std::max(0.0, (c.cost - mine_cost) / by.temperature));
        as_good = by_form || std::abs(behind) <= indistinct;
      }
      if (as_good) {
        alike += std::exp(-std::max(behind, -indistinct));
        out.aliases[k].push_back(name);
        if (behind < least_behind) least_behind = behind, out.better = *c.model;
      } else if (c.score > best) {
        best = c.score, left = c.left, rival = c.model;
      }
    }
    // What goes beside the effect, and does not take its place, says nothing against it.
    double with = own;
    if (rival != nullptr) {
      std::vector<Adopted> both = rival->effects;
      both.push_back(model.effects[k]);
      const GapModel together = choice.search.evaluate(std::move(both), model.kappa);
      if (choice.search.plausible(together)) with = std::max(with, score_of(choice, together, form));
    }
    out.grounds[k][Ground::evidence] = std::asinh(with - best);
    out.grounds[k][Ground::unlike] = std::log10(std::clamp((left - mine_left) / size, least_unlike, 1.0));
    out.together[k] = by.probability(mine, out.grounds[k]);
    out.probability[k] = out.together[k] / alike;
    if (k != order.front()) continue;
    all[mine] = {own, explained_alone(choice, choice.search.evaluate({model.effects[k]}, model.kappa), floor),
                 mine_left};
    put_first(all, own, out.probability[k]);
  }
  if (model.effects.empty()) {
    const FormError none{Eigen::VectorXd::Zero(choice.rows.joints()),
                         Eigen::VectorXd::Zero(choice.rows.joints())};
    std::vector<GapModel> proposed;
    const auto all = candidates(choice, choice.search.none(model.kappa), none, floor, true, proposed);
    double top = -std::numeric_limits<double>::infinity();
    for (const auto& [name, c] : all) top = std::max(top, c.score);
    put_first(all, top, 0.0);
  }
  for (const auto& [name, r] : ranking) out.ranking.push_back(r);
  std::stable_sort(out.ranking.begin(), out.ranking.end(), [](const RankedEffect& a, const RankedEffect& b) {
    return a.probability > b.probability;
  });
  return out;
}

}  // namespace dynid::detail
