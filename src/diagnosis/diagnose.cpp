// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/diagnose.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/signal/filter.hpp"
#include "next_experiment.hpp"
#include "rollout.hpp"
#include "rows.hpp"
#include "search.hpp"
#include "surrogates.hpp"
#include "where.hpp"

namespace dynid {

using detail::Adopted;
using detail::GapModel;
using detail::GapRows;
using detail::RowBlock;
using detail::Search;
using detail::UnitShape;

namespace {

constexpr double floor_room = 3.0;       // coloured noise in parts of the white floor
constexpr double fully_explained = 0.9;  // part of the gap's energy
constexpr double left_by_exact = 0.03;   // of it, by effects of exact forms
constexpr double most_of_exact = 2.5;    // times the noise of most joints
constexpr double detection = 0.05;       // p-value of a gap
constexpr double indistinct = 4.0;       // log evidence between aliases
constexpr double same_delay = 1e-3;      // [s]
constexpr double least_of_delay = 0.02;  // of the gap's energy
constexpr double least_better = 1.0;     // log evidence for the set found with it
constexpr int most_passes = 2;           // of the search with a delay that is known
constexpr double block_seconds = 1.0;    // of held-out blocks and of the bootstrap

/// Part of the gap's energy that so many effects have to explain: several together can imitate much.
double least_explained(std::size_t effects) { return effects < 2 ? 0.65 : effects == 2 ? 0.9 : 0.95; }
constexpr double least_of_fewer = 0.75;  // by one effect, when it is what is left of several

Eigen::VectorXd rms(const Eigen::MatrixXd& x) {
  return (x.colwise().squaredNorm() / double(std::max<Eigen::Index>(1, x.rows()))).cwiseSqrt().transpose();
}

/// What the effects of a model add in any rows: all of them, or one.
Eigen::MatrixXd contribution(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& theta,
                             std::ptrdiff_t only = -1) {
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

/// The same effects, shapes and joints over other rows.
std::vector<Adopted> carried(const GapRows& rows, const std::vector<Adopted>& effects) {
  std::vector<Adopted> out = effects;
  for (Adopted& e : out)
    for (UnitShape& u : e.units) u.block = std::make_shared<RowBlock>(rows.block(*e.h, u.unit, u.shape));
  return out;
}

detail::Fit fit_of(const GapRows& rows, const std::vector<Adopted>& effects, double kappa) {
  std::vector<detail::Term> terms;
  for (const Adopted& e : effects)
    for (const UnitShape& u : e.units) terms.push_back({u.block.get(), e.h});
  return detail::fit_terms(rows, rows.y, terms, kappa);
}

bool has_window(const GapModel& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Adopted& e) { return e.h->scope() == Scope::window; });
}

/// More is left than the effects' forms can be blamed for, those that are not exact having taken `shares` of
/// the gap, and on a joint of an exact one more than noise, whatever its colour, leaves on most: something
/// else is there.
bool inexact(const GapRows& rows, const GapModel& model, const std::vector<double>& shares, double left) {
  const Eigen::VectorXd ratio = rms(model.fit.residual).cwiseQuotient(rows.white_floor);
  std::vector<double> sorted(ratio.begin(), ratio.end());
  std::nth_element(sorted.begin(), sorted.begin() + ratio.size() / 2, sorted.end());
  const double usual = std::max(floor_room, sorted[static_cast<std::size_t>(ratio.size() / 2)]);
  double blamed = left_by_exact;
  bool more = false;
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    const Adopted& e = model.effects[k];
    if (e.h->approximate()) {
      blamed += shares[k];
      continue;
    }
    for (const UnitShape& u : e.units)
      for (const int j : u.block->channels) more = more || ratio[j] > most_of_exact * usual;
  }
  return more && left > blamed;
}

/// [s] by which the effects of a model make the channels late.
Eigen::VectorXd lateness(const GapModel& model, int joints) {
  Eigen::VectorXd late = Eigen::VectorXd::Zero(joints);
  for (const Adopted& e : model.effects)
    for (const UnitShape& u : e.units)
      for (const int j : u.block->channels) late[j] += e.h->lateness(u.shape);
  return late;
}

/// Several channels late by times of their own may all be late by one.
Eigen::VectorXd common(const Eigen::VectorXd& late) {
  std::vector<double> found;
  for (const double x : late)
    if (x != 0.0) found.push_back(x);
  if (found.size() < 3) return late;
  std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2), found.end());
  return Eigen::VectorXd::Constant(late.size(), found[found.size() / 2]);
}

bool has_once(const GapModel& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Adopted& e) { return e.h->once(); });
}

/// Rows in every other block of `seconds`, with a guard of `guard` rows before each change.
std::vector<bool> alternate(const GapRows& rows, bool odd, double seconds, Eigen::Index guard) {
  std::vector<bool> keep(static_cast<std::size_t>(rows.size()));
  const auto mine = [&](Eigen::Index i) { return (static_cast<long>(rows.t[i] / seconds) % 2 == 1) == odd; };
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    bool inside = mine(i);
    for (Eigen::Index k = std::max<Eigen::Index>(0, i - guard);
         inside && k <= std::min(rows.size() - 1, i + guard); ++k)
      inside = mine(k);
    keep[static_cast<std::size_t>(i)] = inside;
  }
  return keep;
}

/// More than coloured noise and the nominal's own errors, where it has any, may leave.
bool left_over(const GapRows& rows, const Eigen::MatrixXd& residual, double tolerance) {
  const Eigen::VectorXd scale = rms(rows.load).cwiseMax(0.05 * rms(rows.load).maxCoeff());
  return (rms(residual).array() > (4.0 * rows.white_floor + tolerance * scale).array()).any();
}

/// There is a gap in the rows, beyond what an inexact nominal leaves.
bool has_gap(const GapRows& everything, const std::vector<bool>& mine, double tolerance) {
  const GapRows rows(everything, mine);
  return left_over(rows, detail::fit_terms(rows, rows.y, {}, tolerance).residual, tolerance);
}

/// Energy in units of the floor, joints pooled.
double energy(const Eigen::MatrixXd& x, const Eigen::VectorXd& floor) {
  return (x * floor.cwiseInverse().asDiagonal()).squaredNorm() / double(std::max<Eigen::Index>(1, x.rows()));
}

/// `after` is larger than `before`, block by block: what happens once, however large, does not decide.
bool worse(const GapRows& rows, const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
           const Eigen::VectorXd& floor) {
  const double noise = double(floor.size());
  double sum = 0.0;
  for (Eigen::Index from = 0, to = 0; from < rows.size(); from = to) {
    const auto block = [&](Eigen::Index i) {
      return std::pair{rows.log[static_cast<std::size_t>(i)], std::floor(rows.t[i] / block_seconds)};
    };
    while (to < rows.size() && block(to) == block(from)) ++to;
    sum += std::log((energy(after.middleRows(from, to - from), floor) + noise) /
                    (energy(before.middleRows(from, to - from), floor) + noise));
  }
  return sum > 0.0;
}

using Say = std::function<void(const char*, double)>;

/// The effects that one part of the rows shows, and the part that judges them.
struct Chosen {
  Chosen(const GapRows& everything, const std::vector<bool>& to_fit, const std::vector<bool>& to_judge,
         const std::vector<const Hypothesis*>& library, const DiagnoseOptions& options, const Say& say)
      : rows(everything, to_fit), held(everything, to_judge), search(checked(), library) {
    say("choosing effects", 0.3);
    const double first_kappa = tuned({search.best(0.0, 1).effects}, options.tolerance);
    model = search.best(first_kappa, options.most_effects);
    std::vector<std::vector<Adopted>> sets = {model.effects};
    for (std::size_t k = 0; k < model.effects.size(); ++k) {
      sets.push_back(model.effects);
      sets.back().erase(sets.back().begin() + static_cast<std::ptrdiff_t>(k));
    }
    const double kappa = tuned(sets, options.tolerance);
    if (kappa != first_kappa) {
      say("choosing effects again", 0.5);
      const GapModel again = search.best(kappa, options.most_effects);
      if (again.score > model.score) model = again;
    }
    keep_what_holds();
  }

  /// What was chosen leaves a gap in the rows that judge, and none where it was chosen.
  bool left_in_held(double tolerance) const {
    if (model.effects.empty() || left_over(rows, model.fit.residual, tolerance)) return false;
    const Eigen::MatrixXd rest = held.y - contribution(held, model, model.fit.theta);
    return left_over(held, detail::fit_terms(held, rest, {}, tolerance).residual, tolerance);
  }

  /// Channels are late by what shows, and that is not all that there is.
  bool lateness_matters() const {
    std::vector<Adopted> others;
    for (const Adopted& e : model.effects)
      if (e.h->lateness(e.units.front().shape) == 0.0) others.push_back(e);
    if (others.size() == model.effects.size() ||
        (others.empty() && !left_over(rows, model.fit.residual, 0.0)))
      return false;
    const Eigen::MatrixXd left = search.evaluate(std::move(others), model.kappa).fit.left;
    return energy(left, rows.white_floor) - energy(model.fit.left, rows.white_floor) >
           least_of_delay * energy(rows.y, rows.white_floor);
  }

  const GapRows rows, held;
  const Search search;
  GapModel model;

 private:
  const GapRows& checked() const {
    if (rows.size() < 40 || held.size() < 10)
      throw Error("diagnosis: " + std::to_string(rows.size()) + " independent rows to fit and " +
                  std::to_string(held.size()) + " to judge by are too few");
    return rows;
  }

  /// How far off the nominal parameters are is found along with the effects: an error of the model must not
  /// be named an effect, nor an effect be taken for such an error.
  double tuned(const std::vector<std::vector<Adopted>>& sets, double tolerance) const {
    double kappa = 0.0, best = search.none(0.0).score;
    for (const auto& set : sets) best = std::max(best, search.evaluate(set, 0.0).score);
    for (const double k : {0.0025, 0.005, 0.01, 0.02, 0.03}) {
      if (k > 1.5 * tolerance) continue;
      double here = search.none(k).score;
      for (const auto& set : sets) here = std::max(here, search.evaluate(set, k).score);
      if (here > best + (kappa > 0.0 ? 0.0 : 2.0)) kappa = k, best = here;
    }
    return kappa;
  }

  /// Beside an effect that does not come back, others have to hold where it is not.
  void keep_what_holds() {
    std::vector<Adopted> once;
    Eigen::MatrixXd rest = held.y;
    for (std::size_t k = 0; k < model.effects.size(); ++k) {
      if (model.effects[k].h->once())
        once.push_back(model.effects[k]);
      else
        rest -= contribution(held, model, model.fit.theta, static_cast<std::ptrdiff_t>(k));
    }
    if (!once.empty() && worse(held, held.y, rest, rows.white_floor))
      model = search.exchanged(search.evaluate(std::move(once), model.kappa));
  }
};

/// Where channels are late, what other effects add there is late too: sought again with that known, until the
/// delay that is found is the one that was assumed, or no better set is. Makes `everything` late as well.
void seek_with_delay(GapRows& everything, std::unique_ptr<Chosen>& chosen, const std::vector<bool>& to_fit,
                     const std::vector<bool>& to_judge, std::vector<const Hypothesis*> library,
                     const DiagnoseOptions& options, const Say& say) {
  Eigen::VectorXd assumed = Eigen::VectorXd::Zero(everything.joints());
  bool better = true;
  for (int pass = 0; pass < most_passes && better && chosen->lateness_matters(); ++pass) {
    better = false;
    const Eigen::VectorXd found = lateness(chosen->model, everything.joints());
    for (const bool by_one : {true, false}) {
      const Eigen::VectorXd late = by_one ? common(found) : found;
      if ((late - assumed).cwiseAbs().maxCoeff() < same_delay || (by_one && late == found)) continue;
      std::vector<const Hypothesis*> forms = library;
      for (const Adopted& e : chosen->model.effects)
        if (by_one && e.h->lateness(e.units.front().shape) != 0.0)
          forms.erase(std::remove(forms.begin(), forms.end(), e.h), forms.end());
      const GapRows delayed = everything.late(late);
      auto again = std::make_unique<Chosen>(delayed, to_fit, to_judge, forms, options, say);
      better = again->model.score > chosen->model.score + least_better;
      if (!better) continue;
      chosen = std::move(again);
      everything = delayed;
      assumed = late;
      library = std::move(forms);
      break;
    }
  }
}

/// What each effect takes of the explained energy, averaged over the orders in which they may come (Shapley;
/// Lindeman, Merenda and Gold 1980), of a sum of 1.
std::vector<double> shapley_shares(const Search& search, const GapModel& model,
                                   const Eigen::VectorXd& floor) {
  const std::size_t count = model.effects.size(), subsets = std::size_t{1} << count;
  std::vector<double> explained(subsets, 0.0), shares(count, 0.0);
  const double before = energy(search.rows().y, floor);
  for (std::size_t subset = 1; subset < subsets; ++subset) {
    std::vector<Adopted> effects;
    for (std::size_t k = 0; k < count; ++k)
      if ((subset >> k & 1U) != 0) effects.push_back(model.effects[k]);
    explained[subset] = before - energy(search.evaluate(std::move(effects), model.kappa).fit.left, floor);
  }
  const auto factorial = [](std::size_t k) { return std::tgamma(double(k) + 1.0); };
  double sum = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t subset = 0; subset < subsets; ++subset) {
      if ((subset >> k & 1U) != 0) continue;
      std::size_t size = 0;
      for (std::size_t i = 0; i < count; ++i) size += subset >> i & 1U;
      shares[k] += factorial(size) * factorial(count - size - 1) / factorial(count) *
                   (explained[subset | std::size_t{1} << k] - explained[subset]);
    }
    shares[k] = std::max(0.0, shares[k]);
    sum += shares[k];
  }
  for (double& share : shares) share = sum > 0.0 ? share / sum : 0.0;
  return shares;
}

double shrink_fraction(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
                       const Eigen::VectorXd& floor) {
  const double noise = double(floor.size()), b = energy(before, floor) - noise,
               a = energy(after, floor) - noise;
  return b > 0.0 ? std::min(1.0, 1.0 - a / b) : 0.0;
}

Shrink shrink_of(const GapRows& rows, const Eigen::MatrixXd& after, const Eigen::VectorXd& floor,
                 unsigned seed) {
  Shrink shrink;
  shrink.before = rms(rows.y);
  shrink.after = rms(after);
  shrink.floor = floor;
  shrink.fraction = shrink_fraction(rows.y, after, floor);
  // Blocks drawn with replacement.
  std::vector<std::vector<Eigen::Index>> blocks;
  double open = -1.0;
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    const double block = std::floor(rows.t[i] / block_seconds) + 1e6 * rows.log[static_cast<std::size_t>(i)];
    if (block != open) blocks.emplace_back();
    open = block;
    blocks.back().push_back(i);
  }
  std::mt19937_64 random(seed);
  std::vector<double> fractions;
  for (int k = 0; k < 200; ++k) {
    std::vector<Eigen::Index> drawn;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const auto& block = blocks[random() % blocks.size()];
      drawn.insert(drawn.end(), block.begin(), block.end());
    }
    fractions.push_back(shrink_fraction(rows.y(drawn, Eigen::all), after(drawn, Eigen::all), floor));
  }
  std::sort(fractions.begin(), fractions.end());
  shrink.low = std::min(shrink.fraction, fractions[10]);
  shrink.high = std::max(shrink.fraction, fractions[189]);
  return shrink;
}

constexpr double within_seconds = 0.4;

/// A contact does not come again: its window is fitted in every other block and judged in those between.
GapModel fitted_within(const GapRows& rows, const GapModel& model) {
  const GapRows odd(rows, alternate(rows, true, within_seconds, 1));
  GapModel part = model;
  part.effects = carried(odd, model.effects);
  part.fit = fit_of(odd, part.effects, model.kappa);
  return part;
}
Shrink shrink_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor,
                     unsigned seed) {
  const GapRows even(rows, alternate(rows, false, within_seconds, 1));
  const GapModel part = fitted_within(rows, model);
  return shrink_of(even, even.y - contribution(even, part, part.fit.theta), floor, seed);
}

/// The window of an effect of the model, in the log where it explains most.
GapWindow found_window(const Robot& robot, const GapRows& rows, const GapModel& model, std::size_t which,
                       const std::vector<std::string>& logs) {
  const UnitShape& u = model.effects[which].units.front();
  const Eigen::MatrixXd with =
      model.fit.left + contribution(rows, model, model.fit.theta, static_cast<std::ptrdiff_t>(which));
  std::vector<double> taken(logs.size(), 0.0);
  for (Eigen::Index i = 0; i < rows.size(); ++i)
    taken[static_cast<std::size_t>(rows.log[static_cast<std::size_t>(i)])] +=
        with.row(i).squaredNorm() - model.fit.left.row(i).squaredNorm();
  const auto log = std::max_element(taken.begin(), taken.end()) - taken.begin();
  return {logs[static_cast<std::size_t>(log)], u.shape[0], u.shape[0] + u.shape[1],
          model.effects[which].h->joints(robot, u.unit)};
}

/// In the place of those of its log that it meets.
void put_window(std::vector<GapWindow>& windows, const GapWindow& found) {
  windows.erase(std::remove_if(windows.begin(), windows.end(),
                               [&](const GapWindow& w) {
                                 return w.log == found.log && w.t0 < found.t1 && found.t0 < w.t1;
                               }),
                windows.end());
  windows.insert(windows.begin(), found);
}

/// The values of an effect over all its units, arrays over joints filled with zeros elsewhere.
struct Values {
  std::vector<std::string> keys, units;
  std::vector<bool> per_joint;
  std::vector<Eigen::VectorXd> values;
};
Values values_of(const Robot& robot, const Adopted& e, const Eigen::VectorXd& theta,
                 const std::vector<Eigen::VectorXd>& shapes) {
  Values out;
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < e.units.size(); ++k) {
    const Eigen::Index p = e.h->shape_only() ? 0 : e.units[k].block->size();
    const std::vector<NamedValue> named =
        e.h->parameters(robot, e.units[k].unit, theta.segment(at, p), shapes[k]);
    at += p;
    for (std::size_t i = 0; i < named.size(); ++i) {
      if (k == 0) {
        out.keys.push_back(named[i].key);
        out.units.push_back(named[i].unit);
        out.per_joint.push_back(named[i].per_joint);
        out.values.push_back(named[i].per_joint ? Eigen::VectorXd::Zero(robot.size()) : named[i].value);
      } else if (out.units[i].find(named[i].unit) == std::string::npos)
        out.units[i] += " or " + named[i].unit;  // joints of both types
      if (named[i].per_joint) out.values[i][e.units[k].unit] = named[i].value[0];
    }
  }
  return out;
}

/// Estimates with 90 % intervals: coefficients and shapes drawn together from the fit's covariance, which
/// takes in the derivatives with respect to the shapes.
FoundEffect found_effect(const Robot& robot, const GapRows& rows, const GapModel& model, std::size_t which,
                         const detail::Fit& fit, unsigned seed) {
  const Adopted& e = model.effects[which];
  // Covariance of everything that is free in the model.
  Eigen::Index at = 0, first = 0, mine = 0;
  std::vector<RowBlock> slopes;
  std::vector<detail::Term> terms;
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    if (k == which) first = at;
    for (const UnitShape& u : model.effects[k].units) {
      terms.push_back({u.block.get(), model.effects[k].h});
      at += model.effects[k].h->shape_only() ? 0 : u.block->size();
    }
    if (k == which) mine = at - first;
  }
  const Eigen::Index all = at;
  const std::vector<ShapeParameter> shape = e.h->shape();
  std::vector<std::pair<std::size_t, Eigen::Index>> shape_of;  // unit, shape
  Eigen::Index offset = first;
  for (std::size_t k = 0; k < e.units.size(); ++k) {
    const UnitShape& u = e.units[k];
    const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
    for (Eigen::Index s = 0; s < u.shape.size(); ++s) {
      if (shape[static_cast<std::size_t>(s)].points < 3 && e.h->scope() != Scope::window) continue;
      const double step = e.h->scope() == Scope::window ? 1e-3 : 1e-3 * std::max(std::abs(u.shape[s]), 1e-3);
      Eigen::VectorXd ahead = u.shape, behind = u.shape;
      ahead[s] += step;
      behind[s] -= step;
      const RowBlock a = rows.block(*e.h, u.unit, ahead), b = rows.block(*e.h, u.unit, behind);
      RowBlock slope;
      slope.channels = a.channels;
      for (std::size_t c = 0; c < a.channels.size(); ++c) {
        const Eigen::MatrixXd d = (a.values[c] - b.values[c]) / (2.0 * step);
        slope.values.push_back(p > 0 ? Eigen::MatrixXd(d * fit.theta.segment(offset, p))
                                     : Eigen::MatrixXd(d.rowwise().sum()));
      }
      slopes.push_back(std::move(slope));
      shape_of.emplace_back(k, s);
    }
    offset += p;
  }
  for (const RowBlock& slope : slopes) terms.push_back({&slope});
  const Eigen::MatrixXd wide = detail::covariance_of(rows, terms, fit.noise, model.kappa);
  const auto extra = static_cast<Eigen::Index>(slopes.size());
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index k = 0; k < mine; ++k) chosen.push_back(first + k);
  for (Eigen::Index k = 0; k < extra; ++k) chosen.push_back(all + k);
  const Eigen::MatrixXd covariance = wide(chosen, chosen);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  const Eigen::MatrixXd root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();

  std::vector<Eigen::VectorXd> shapes;
  for (const UnitShape& u : e.units) shapes.push_back(u.shape);
  const Eigen::VectorXd theta = fit.theta.segment(first, mine);
  const Values best = values_of(robot, e, theta, shapes);
  constexpr int draws = 400;
  std::vector<Eigen::MatrixXd> drawn;
  for (const Eigen::VectorXd& v : best.values) drawn.emplace_back(v.size(), draws);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double factor = model.kappa > 0.0 ? calibration().interval_factor_off : calibration().interval_factor;
  for (int d = 0; d < draws; ++d) {
    Eigen::VectorXd z(chosen.size());
    for (double& x : z) x = normal(random);
    const Eigen::VectorXd change = factor * (root * z);
    std::vector<Eigen::VectorXd> moved = shapes;
    for (Eigen::Index k = 0; k < extra; ++k) {
      const auto& [unit, s] = shape_of[static_cast<std::size_t>(k)];
      const ShapeParameter& range = shape[static_cast<std::size_t>(s)];
      moved[unit][s] = std::clamp(moved[unit][s] + change[mine + k], range.low, range.high);
    }
    const Values v = values_of(robot, e, theta + change.head(mine), moved);
    for (std::size_t k = 0; k < v.values.size(); ++k) drawn[k].col(d) = v.values[k];
  }
  FoundEffect found;
  found.effect.name = e.h->name();
  for (const UnitShape& u : e.units)
    for (const int j : e.h->joints(robot, u.unit)) found.effect.joints.push_back(j);
  for (std::size_t k = 0; k < best.keys.size(); ++k) {
    Estimate estimate{best.keys[k],   best.units[k],  best.values[k],
                      best.values[k], best.values[k], best.per_joint[k]};
    for (Eigen::Index i = 0; i < best.values[k].size(); ++i) {
      Eigen::VectorXd x = drawn[k].row(i).transpose();
      std::sort(x.data(), x.data() + x.size());
      const double value = estimate.value[i], below = std::max(0.0, value - x[draws / 20]),
                   above = std::max(0.0, x[draws - 1 - draws / 20] - value);
      // What is chosen (a link, a sign), not measured, has no interval.
      const bool measured = below > 0.0 || above > 0.0;
      const double form =
          measured ? calibration().form_error_of(e.h->name(), best.keys[k]) * Calibration::scale(estimate, i)
                   : 0.0;
      estimate.low[i] = value - std::hypot(below, form);
      estimate.high[i] = value + std::hypot(above, form);
    }
    found.effect.parameters[best.keys[k]] =
        std::vector<double>(best.values[k].data(), best.values[k].data() + best.values[k].size());
    found.parameters.push_back(std::move(estimate));
  }
  return found;
}

/// What no diagnosis can be built on: torques that are not measured, a velocity that is not that of the
/// positions.
std::vector<DataIssue> unusable(const std::vector<Log>& logs, const std::vector<PreparedLog>& prepared) {
  constexpr double moving = 0.02;           // [rad/s], [m/s]
  constexpr double largest_mismatch = 0.5;  // of the velocity
  std::vector<DataIssue> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    std::vector<int> dead, other;
    double worst = 0.0;
    for (int j = 0; j < logs[l].joints(); ++j) {
      if (logs[l].tau.col(j).maxCoeff() == logs[l].tau.col(j).minCoeff()) dead.push_back(j + 1);
      double speed = 0.0, mismatch = 0.0;
      for (const Segment& s : prepared[l].segments) {
        const Eigen::VectorXd rate = differentiate(s.q.col(j), s.rate);
        speed += rate.squaredNorm();
        Eigen::MatrixXd logged = s.speed.col(j);
        ZeroPhaseButterworth(prepared[l].cutoff, s.rate).apply(logged);
        mismatch += (logged - rate).squaredNorm();
      }
      double samples = 0.0;
      for (const Segment& s : prepared[l].segments) samples += double(s.t.size());
      if (speed < moving * moving * samples) continue;
      if (mismatch > largest_mismatch * largest_mismatch * speed) other.push_back(j + 1);
      worst = std::max(worst, std::sqrt(mismatch / speed));
    }
    if (!dead.empty())
      out.push_back({"torque_missing", dead, double(dead.size()), "1",
                     logs[l].source + ": a torque channel never changes"});
    if (!other.empty())
      out.push_back({"velocity_mismatch", other, worst, "1",
                     logs[l].source + ": the velocity is not that of the positions (another unit?)"});
  }
  return out;
}

}  // namespace

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_gap:
      return "no_gap";
    case Verdict::not_detected:
      return "not_detected";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::unexplained:
      return "unexplained";
    case Verdict::data_invalid:
      break;
  }
  return "data_invalid";
}

Diagnosis diagnose(const Robot& nominal, const std::vector<Log>& logs, const DiagnoseOptions& options) {
  const auto began = std::chrono::steady_clock::now();
  const auto say = [&](const char* stage, double fraction) {
    if (options.progress) options.progress(stage, fraction);
  };
  if (logs.empty()) throw Error("diagnosis: no log");
  for (const Log& log : logs)
    if (log.joints() != nominal.size())
      throw Error(log.source + ": " + std::to_string(log.joints()) + " joints, the model has " +
                  std::to_string(nominal.size()));
  Diagnosis out;
  say("checking the data", 0.0);
  PrepareOptions prepare_options;
  prepare_options.cutoff = options.cutoff;
  if (options.cutoff == 0.0) {
    // Wide enough for the corners of friction, where the sampling allows it.
    prepare_options.cutoff = 10.0;
    for (const Log& log : logs)
      prepare_options.cutoff = std::min(prepare_options.cutoff, std::max(8.0, choose_cutoff(log)));
    for (const Log& log : logs) {
      const double rate = double(log.samples() - 1) / std::max(1e-9, log.t[log.samples() - 1] - log.t[0]);
      prepare_options.cutoff = std::min(prepare_options.cutoff, rate / 6.0);
    }
  }
  out.cutoff = prepare_options.cutoff;
  prepare_options.speed_cutoff = detail::speed_band;
  for (const Log& log : logs) out.logs.push_back(prepare(log, prepare_options));

  // What chooses and fits, and what only judges.
  say("nominal model", 0.05);
  const bool several = out.logs.size() > 1;
  GapRows everything(nominal, out.logs);
  const Eigen::Index guard = 4;
  std::vector<bool> first(static_cast<std::size_t>(everything.size())), last = first;
  if (several) {
    for (std::size_t i = 0; i < first.size(); ++i) {
      last[i] = everything.log[i] + 1 == static_cast<int>(out.logs.size());
      first[i] = !last[i];
    }
  } else {
    first = alternate(everything, false, block_seconds, guard);
    last = alternate(everything, true, block_seconds, guard);
  }
  // What shows in one log alone (a contact, a limit that the others never meet) is sought there, judged
  // within it, and must do no harm to the others.
  bool alone = false;
  if (several) {
    const bool in_first = has_gap(everything, first, options.tolerance),
               in_last = has_gap(everything, last, options.tolerance);
    alone = in_first != in_last;
    if (in_last && !in_first) std::swap(first, last);
  }
  out.rms = rms(everything.y);
  out.floor = everything.white_floor;
  const std::vector<DataIssue> invalid = unusable(logs, out.logs);
  for (PreparedLog& log : out.logs) log.segments.clear();
  if (!invalid.empty()) {
    out.logs.front().report.issues.insert(out.logs.front().report.issues.begin(), invalid.begin(),
                                          invalid.end());
    out.verdict = Verdict::data_invalid;
    out.shrink.before = out.shrink.after = out.rms;
    out.shrink.floor = out.floor;
    out.series = {everything.log, everything.t, everything.y, everything.y, last};
    for (const auto& h : hypotheses())
      if (out.ranking.empty() || out.ranking.back().first != h->name())
        out.ranking.emplace_back(h->name(), 0.0);
    out.next.text = "Record again: " + invalid.front().text + ".";
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    return out;
  }
  std::vector<const Hypothesis*> library;
  for (const auto& h : hypotheses())
    if (std::find(options.withhold.begin(), options.withhold.end(), h->name()) == options.withhold.end())
      library.push_back(h.get());
  library.insert(library.end(), options.extra.begin(), options.extra.end());
  auto chosen = std::make_unique<Chosen>(everything, first, last, library, options, say);
  if (several && !alone && chosen->left_in_held(options.tolerance)) {
    // And so is what the last log alone has beside the effects of all.
    auto other = std::make_unique<Chosen>(everything, last, first, library, options, say);
    if (has_window(other->model)) {
      chosen = std::move(other);
      std::swap(first, last);
      alone = true;
    }
  }
  seek_with_delay(everything, chosen, first, last, library, options, say);
  const GapRows &rows = chosen->rows, &held = chosen->held;
  const Search& search = chosen->search;
  GapModel& model = chosen->model;
  const GapModel none = search.none(model.kappa);
  out.nominal_error = model.kappa;

  // Is there a gap at all?
  say("surrogates", 0.7);
  const std::vector<Eigen::MatrixXd> drawn =
      detail::surrogates(rows, none.fit.residual, options.surrogates, options.seed);
  out.p_value = search.p_value(none.fit.residual, drawn);
  // The floor: white noise, or what is left where that is coloured; not what no effect explains.
  const Eigen::VectorXd noise =
      rms(model.fit.residual).cwiseMin(floor_room * rows.white_floor).cwiseMax(rows.white_floor);
  out.floor = noise;
  out.where = detail::locate(rows, rms(model.fit.residual).cwiseMax(rows.white_floor),
                             detail::surrogates(rows, rows.y, options.surrogates, options.seed));

  const auto unexplained = [&](const Eigen::MatrixXd& residual) {
    return left_over(rows, residual, model.kappa > 0.0 ? options.tolerance : 0.0);
  };
  const auto taken = [&](const GapRows& of, const Eigen::MatrixXd& residual) {
    return std::clamp(shrink_fraction(of.y, residual, noise), 0.0, 1.0);
  };
  const auto explained = [&](const GapModel& m, Shrink& shrink) {
    if (m.effects.empty()) return 0.0;
    double least = taken(rows, m.fit.residual);
    const bool window = has_window(m);
    if (window || alone) shrink = shrink_within(rows, m, noise, options.seed);
    if (!has_once(m)) {
      // What was found has to hold where it was not found.
      const auto left = [&](const Eigen::MatrixXd& y) -> Eigen::MatrixXd {
        return detail::fit_terms(held, y, {}, m.kappa).residual;
      };
      const Eigen::MatrixXd rest = left(held.y - contribution(held, m, m.fit.theta));
      if (!alone)
        least = std::min(least, taken(held, rest));
      else if (worse(held, left(held.y), rest, noise))
        least = 0.0;
    } else if (!window && !alone && unexplained(detail::fit_terms(held, held.y, {}, m.kappa).residual)) {
      // A drift starts anew in each log, or is over: it may come back at another size, but nothing else may.
      least = std::min(least, taken(held, fit_of(held, carried(held, m.effects), m.kappa).residual));
    }
    if ((window && m.effects.size() == 1) || alone)  // a window of anything fits
      least = std::min(least, std::max(0.0, shrink.fraction));
    return least;
  };
  out.explained = explained(model, out.shrink);
  std::vector<double> shares = shapley_shares(search, model, noise);
  while (model.effects.size() > 1 && out.explained < least_explained(model.effects.size())) {
    // Too little for so many: perhaps enough for fewer.
    std::vector<Adopted> fewer = model.effects;
    fewer.erase(fewer.begin() + (std::min_element(shares.begin(), shares.end()) - shares.begin()));
    GapModel smaller = search.evaluate(std::move(fewer), model.kappa);
    Shrink shrink;
    const double here = explained(smaller, shrink);
    if (smaller.effects.size() == 1 && here < least_of_fewer) break;
    model = std::move(smaller);
    out.explained = here;
    out.shrink = std::move(shrink);
    shares = shapley_shares(search, model, noise);
  }
  const bool windowed = has_window(model), within = windowed || (alone && !model.effects.empty());
  if (model.effects.empty()) {
    if (unexplained(model.fit.residual))
      out.verdict = Verdict::unexplained;
    else
      out.verdict = out.p_value <= detection ? Verdict::not_detected : Verdict::no_gap;
  } else if (out.explained < least_explained(model.effects.size()) ||
             inexact(rows, model, shares, 1.0 - out.explained)) {
    out.verdict = unexplained(none.fit.residual) ? Verdict::unexplained : Verdict::not_detected;
  } else {
    out.verdict = unexplained(model.fit.residual) && out.explained < fully_explained
                      ? Verdict::partly_explained
                      : Verdict::explained;
  }
  if (out.verdict == Verdict::no_gap || out.verdict == Verdict::not_detected)
    out.smallest_visible = search.smallest_visible(none);

  // Which effect could stand in the place of each.
  say("alternatives", 0.8);
  const bool adopt = out.verdict == Verdict::explained || out.verdict == Verdict::partly_explained;
  std::vector<std::size_t> order(model.effects.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return shares[a] > shares[b]; });
  const GapRows& whole = windowed ? rows : everything;
  const std::vector<Adopted> final_effects = carried(whole, model.effects);
  GapModel final_model = model;
  final_model.effects = final_effects;
  final_model.fit = fit_of(whole, final_effects, model.kappa);
  std::map<std::string, double> ranking;
  const double temperature = calibration().temperature;
  // Not only the others compared may be right instead, but none of them.
  const double sure =
      1.0 - std::min(0.99, calibration().doubt + calibration().doubt_of_rest * (1.0 - out.explained));
  for (const std::size_t k : order) {
    std::vector<Adopted> others = model.effects;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const GapModel base = search.evaluate(others, model.kappa);
    std::map<std::string, double> scores = {{model.effects[k].h->name(), model.score}};
    FoundEffect found;
    if (adopt)
      found = found_effect(nominal, whole, final_model, k, final_model.fit,
                           options.seed + static_cast<unsigned>(k));
    for (const GapModel& m : search.alternatives(base, 8)) {
      const std::string name = m.effects.back().h->name();
      double& best = scores.emplace(name, m.score).first->second;
      best = std::max(best, m.score);
      if (name != model.effects[k].h->name() && m.fit.total > model.fit.total - indistinct)
        found.aliases.push_back(name);
    }
    double sum = 0.0;
    for (const auto& [name, s] : scores) sum += std::exp((s - model.score) / temperature);
    found.probability = sure / sum;
    if (k == order.front())
      for (const auto& [name, s] : scores)
        ranking[name] = sure * std::exp((s - model.score) / temperature) / sum;
    found.share = shares[k];
    if (adopt) out.effects.push_back(std::move(found));
  }
  for (const Hypothesis* h : library) ranking.emplace(h->name(), 0.0);
  out.ranking.assign(ranking.begin(), ranking.end());
  std::stable_sort(out.ranking.begin(), out.ranking.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });

  // How far it shrinks where nothing was chosen or fitted.
  say("shrink", 0.95);
  if (!within) {
    const Eigen::MatrixXd rest =
        adopt ? Eigen::MatrixXd(held.y - contribution(held, model, model.fit.theta)) : held.y;
    out.shrink = shrink_of(held, rest, noise, options.seed);
  }
  out.series = {everything.log, everything.t, everything.y, everything.y, last};
  Eigen::VectorXd theta = model.fit.theta;
  if (adopt && within && several) {  // judged where it shows
    theta = fitted_within(rows, model).fit.theta;
    out.series.held_out = alternate(everything, false, within_seconds, 1);
    for (std::size_t i = 0; i < first.size(); ++i)
      out.series.held_out[i] = out.series.held_out[i] && first[i];
  }
  Eigen::MatrixXd passing = everything.y;  // without what is always there
  for (std::size_t k = 0; adopt && k < model.effects.size(); ++k) {
    Eigen::MatrixXd part = contribution(everything, model, theta, static_cast<std::ptrdiff_t>(k));
    const bool window = model.effects[k].h->scope() == Scope::window;
    if (several && window)  // a window is of the logs it was found in
      for (std::size_t i = 0; i < last.size(); ++i)
        if (last[i]) part.row(static_cast<Eigen::Index>(i)).setZero();
    out.series.after -= part;
    if (!window) passing -= part;
  }
  std::vector<std::string> names;
  for (const Log& log : logs) names.push_back(log.source);
  out.windows = detail::windows(everything, passing, names);
  for (std::size_t k = 0; adopt && k < model.effects.size(); ++k)
    if (model.effects[k].h->scope() == Scope::window)
      put_window(out.windows, found_window(nominal, rows, model, k, names));
  if (options.replay) {
    say("replaying the motion", 0.97);
    out.rollout = detail::roll_out(nominal, out.effects, everything, last);
    out.next = detail::next_experiment(nominal, out);
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return out;
}

Robot patched(const Robot& nominal, const std::vector<FoundEffect>& effects) {
  Robot robot = nominal;
  for (const FoundEffect& found : effects) {
    const Effect effect = checked_effect(found.effect, robot);
    if (!enter_effect(robot, effect)) robot.effects.push_back(effect);
  }
  return robot;
}

}  // namespace dynid
