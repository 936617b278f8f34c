// SPDX-License-Identifier: Apache-2.0
#include "select.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "effects/effects.hpp"
#include "energy.hpp"

namespace dynid::detail {
namespace {

constexpr int most_passes = 2;               // of the search with a delay that is known
constexpr std::size_t other_beginnings = 4;  // each costs a whole search

/// Several channels late by times of their own may all be late by one.
Eigen::VectorXd common(const Eigen::VectorXd& late) {
  std::vector<double> found;
  for (const double x : late)
    if (x != 0.0) found.push_back(x);
  if (found.size() < 3) return late;
  std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2), found.end());
  return Eigen::VectorXd::Constant(late.size(), found[found.size() / 2]);
}

/// Sought again with the delay known, until the one that is found is the one that was assumed, or no better
/// set is.
void seek_with_delay(GapRows& everything, std::unique_ptr<Choice>& chosen,
                     std::vector<const Hypothesis*> library, const DiagnoseOptions& options, const Say& say) {
  const Criteria& criteria = options.criteria;
  Eigen::VectorXd assumed = Eigen::VectorXd::Zero(everything.joints());
  bool better = true;
  for (int pass = 0; pass < most_passes && better && chosen->lateness_matters(); ++pass) {
    better = false;
    const Eigen::VectorXd found = lateness(chosen->model, everything.joints());
    for (const bool by_one : {true, false}) {
      const Eigen::VectorXd late = by_one ? common(found) : found;
      if ((late - assumed).cwiseAbs().maxCoeff() < criteria.same_delay * everything.period() ||
          (by_one && late == found))
        continue;
      std::vector<const Hypothesis*> forms = library;
      for (const Adopted& e : chosen->model.effects)
        if (by_one && e.h->lateness(e.units.front().shape) != 0.0)
          forms.erase(std::remove(forms.begin(), forms.end(), e.h), forms.end());
      const GapRows delayed = everything.late(late);
      auto again = std::make_unique<Choice>(delayed, chosen->split, forms, options, say);
      better = again->model.score > chosen->model.score + criteria.least_better;
      if (!better) continue;
      chosen = std::move(again);
      everything = delayed;
      assumed = late;
      library = std::move(forms);
      break;
    }
  }
}

}  // namespace

Choice::Choice(const GapRows& everything, const Split& rows_split,
               const std::vector<const Hypothesis*>& library, const DiagnoseOptions& options, const Say& say)
    : split(rows_split),
      rows(everything, split.to_fit),
      held(everything, split.to_judge),
      search(rows, library, options.criteria) {
  say("choosing effects", 0.3);
  const double first_kappa = tuned({search.best(0.0, 1).effects}, options.tolerance);
  Trail trail;
  model = search.grown(search.none(first_kappa), options.most_effects, &trail);
  std::vector<std::vector<Adopted>> sets = {model.effects};
  for (std::size_t k = 0; k < model.effects.size(); ++k) sets.push_back(without(model.effects, k));
  const double kappa = tuned(sets, options.tolerance);
  if (kappa != first_kappa) {
    say("choosing effects again", 0.5);
    const GapModel again = search.grown(search.evaluate(model.effects, kappa), options.most_effects, &trail);
    if (again.score > model.score) model = again;
  }
  begin_with_errors(options, trail);
  const auto settle = [&] {
    if (!split.several) settle_windows(everything);
    if (keep_what_holds() && !split.several) settle_windows(everything);
  };
  settle();
  if (leaves_gap(options.tolerance) && begun_elsewhere(options.most_effects, trail)) settle();
}

Choice::Choice(const GapRows& everything, const Split& rows_split, const Choice& sought)
    : split(rows_split),
      rows(everything, split.to_fit),
      held(everything, split.to_judge),
      search(rows, sought.search),
      model(search.moved_here(sought.model.effects, sought.model.kappa)) {}

bool Choice::leaves_gap(double tolerance) const {
  if (model.effects.empty()) return false;
  Eigen::MatrixXd rest = held.y;
  for (std::size_t k = 0; k < model.effects.size(); ++k)
    if (!split.several || !model.effects[k].h->once())
      rest -= contribution(held, model, model.fit.theta, static_cast<std::ptrdiff_t>(k));
  return left_over(rows, model.fit.residual, tolerance, criteria()) ||
         left_over(held, fit_terms(held, rest, {}, tolerance).residual, tolerance, criteria());
}

bool Choice::begun_elsewhere(int most, const Trail& trail) {
  bool better = false;
  std::vector<GapModel> beginnings = search.alternatives(search.none(model.kappa), 8);
  if (beginnings.size() > other_beginnings) beginnings.resize(other_beginnings);
  tbb::parallel_for(std::size_t{0}, beginnings.size(), [&](std::size_t k) {
    Trail own = trail;
    beginnings[k] = search.grown(beginnings[k], most, &own);
  });
  for (GapModel& other : beginnings)
    if (other.score > model.score + criteria().least_better) model = std::move(other), better = true;
  return better;
}

void Choice::begin_with_errors(const DiagnoseOptions& options, Trail& trail) {
  const Criteria& by = criteria();
  const auto body = [](const Adopted& e) {
    return e.h->scope() == Scope::link || e.h->scope() == Scope::arm;
  };
  if (!without_friction(search.robot())) return;
  for (const double off : {by.most_off, by.never_identified}) {
    if (std::none_of(model.effects.begin(), model.effects.end(), body)) return;
    const double kappa = off * options.tolerance;
    if (kappa <= model.kappa) continue;
    std::vector<Adopted> others;
    for (const Adopted& e : model.effects)
      if (!body(e)) others.push_back(e);
    GapModel other = search.grown(search.evaluate(std::move(others), kappa), options.most_effects, &trail);
    if (other.score > model.score + by.off_gain) model = std::move(other);
  }
}

bool Choice::left_in_held(double tolerance) const {
  if (model.effects.empty() || left_over(rows, model.fit.residual, tolerance, criteria())) return false;
  const Eigen::MatrixXd rest = held.y - contribution(held, model, model.fit.theta);
  return left_over(held, fit_terms(held, rest, {}, tolerance).residual, tolerance, criteria());
}

bool Choice::lateness_matters() const {
  std::vector<Adopted> others;
  for (const Adopted& e : model.effects)
    if (e.h->lateness(e.units.front().shape) == 0.0) others.push_back(e);
  if (others.size() == model.effects.size() ||
      (others.empty() && !left_over(rows, model.fit.residual, 0.0, criteria())))
    return false;
  const Eigen::MatrixXd left = search.evaluate(std::move(others), model.kappa).fit.left;
  return energy(left, rows.white_floor) - energy(model.fit.left, rows.white_floor) >
         criteria().least_of_delay * energy(rows.y, rows.white_floor);
}

double Choice::tuned(const std::vector<std::vector<Adopted>>& sets, double tolerance) const {
  std::vector<double> levels = {0.0};
  for (const double k : {0.0025, 0.005, 0.01, 0.02, 0.03})
    if (k <= criteria().most_off * tolerance) levels.push_back(k);
  const std::size_t of_level = sets.size() + 1;  // without an effect, and each set
  std::vector<double> scores(levels.size() * of_level);
  tbb::parallel_for(std::size_t{0}, scores.size(), [&](std::size_t i) {
    const double k = levels[i / of_level];
    scores[i] = i % of_level == 0 ? search.none(k).score : search.evaluate(sets[i % of_level - 1], k).score;
  });
  const auto best_of = [&](std::size_t level) {
    const auto first = scores.begin() + static_cast<std::ptrdiff_t>(level * of_level);
    return *std::max_element(first, first + static_cast<std::ptrdiff_t>(of_level));
  };
  double kappa = 0.0, best = best_of(0);
  for (std::size_t level = 1; level < levels.size(); ++level) {
    const double here = best_of(level);
    if (here > best + (kappa > 0.0 ? 0.0 : criteria().off_gain)) kappa = levels[level], best = here;
  }
  return kappa;
}

void Choice::settle_windows(const GapRows& everything) {
  if (!has_window(model) || everything.size() > criteria().searched_rows) return;
  std::vector<Adopted> effects = carried(everything, model.effects);
  double best = fit_of(everything, effects, model.kappa).total;
  for (Adopted& effect : effects) {
    if (effect.h->scope() != Scope::window) continue;
    UnitShape& unit = effect.units.front();
    const std::vector<ShapeParameter> parameters = everything.shape(*effect.h, unit.unit);
    const auto tried = [&](const Eigen::VectorXd& shape) {
      const UnitShape before = unit;
      unit.shape = shape;
      unit.block = std::make_shared<RowBlock>(everything.block(*effect.h, unit.unit, shape));
      const double here = fit_of(everything, effects, model.kappa).total;
      if (here > best)
        best = here;
      else
        unit = before;
    };
    const auto move_ends = [&](double step) {
      for (const auto& [start, end] : {std::pair{-step, 0.0}, {step, 0.0}, {0.0, -step}, {0.0, step}}) {
        Eigen::VectorXd shape = unit.shape;
        shape[0] += start;
        shape[1] += end - start;
        if (shape[1] >= everything.period()) tried(shape);
      }
    };
    // How fast: what is in the middle of its rise, and of its fall, stays where it is.
    const auto change_rise = [&](Eigen::Index s, double by) {
      const ShapeParameter& p = parameters[static_cast<std::size_t>(s)];
      if (!p.logarithmic) return;
      Eigen::VectorXd shape = unit.shape;
      const double before = shape[s];
      shape[s] = std::clamp(by * before, p.low, p.high);
      shape[0] += 0.5 * (before - shape[s]);
      shape[1] -= before - shape[s];
      if (shape[1] >= everything.period()) tried(shape);
    };
    // Steps that began small may have led astray: large ones again, until they change nothing.
    double last = -std::numeric_limits<double>::infinity();
    while (best > last + criteria().least_better) {
      last = best;
      double factor = 4.0;
      for (double step = block_length(everything); step >= 0.5 * everything.period(); step /= 2.0) {
        move_ends(step);
        for (Eigen::Index s = 2; s < unit.shape.size(); ++s)
          for (const double by : {1.0 / factor, factor}) change_rise(s, by);
        factor = std::sqrt(factor);
      }
    }
  }
  model = search.moved_here(effects, model.kappa);
}

bool Choice::keep_what_holds() {
  std::vector<Adopted> once;
  Eigen::MatrixXd rest = held.y;
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    if (model.effects[k].h->once())
      once.push_back(model.effects[k]);
    else
      rest -= contribution(held, model, model.fit.theta, static_cast<std::ptrdiff_t>(k));
  }
  if (once.empty() || !worse(held, held.y, rest, rows.white_floor)) return false;
  model = search.exchanged(search.evaluate(std::move(once), model.kappa));
  return true;
}

std::unique_ptr<Choice> select(GapRows& everything, const Split& split,
                               const std::vector<const Hypothesis*>& library, const DiagnoseOptions& options,
                               const Say& say) {
  auto chosen = std::make_unique<Choice>(everything, split, library, options, say);
  const bool enough = chosen->held.size() >= least_to_fit && chosen->rows.size() >= least_to_judge;
  if (split.several && !split.alone && enough && chosen->left_in_held(options.tolerance)) {
    // So is what the last log alone has beside the effects of all.
    auto other = std::make_unique<Choice>(everything, split.swapped(), library, options, say);
    if (has_window(other->model)) {
      chosen = std::move(other);
    } else if (!other->model.effects.empty() && !other->leaves_gap(options.tolerance)) {
      // It shows more of what all logs have: a limit that the others hardly meet.
      other->split.alone = false;
      chosen = std::move(other);
    }
  }
  seek_with_delay(everything, chosen, library, options, say);
  return chosen;
}

}  // namespace dynid::detail
