// SPDX-License-Identifier: Apache-2.0
#include "judge.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "energy.hpp"
#include "held_out.hpp"
#include "shares.hpp"

namespace dynid::detail {
namespace {

class Judge {
 public:
  Judge(const Choice& choice, const Eigen::VectorXd& noise, const DiagnoseOptions& options)
      : choice_(choice), noise_(noise), options_(options), criteria_(options.criteria) {}

  /// Least part of the gap that a model explains, where it was fitted and where it was not; `shrink` where
  /// that is found within the rows.
  double explained(const GapModel& m, Shrink& shrink) const {
    if (m.effects.empty()) return 0.0;
    const GapRows &rows = choice_.rows, &held = choice_.held;
    const bool window = has_window(m), alone = choice_.split.alone;
    double least = taken(rows, m.fit.residual);
    if (window || alone) shrink = shrink_within(rows, m, noise_, options_.seed);
    const auto left = [&](const Eigen::MatrixXd& y) -> Eigen::MatrixXd {
      return fit_terms(held, y, {}, m.kappa).residual;
    };
    if (!has_once(m)) {
      // What was found has to hold where it was not found.
      const Eigen::MatrixXd rest = left(held.y - contribution(held, m, m.fit.theta));
      if (!alone)
        least = std::min(least, taken(held, rest));
      else if (worse(held, left(held.y), rest, noise_))
        least = 0.0;
    } else if (!window && !alone && unexplained(left(held.y), m.kappa)) {
      // A drift starts anew in each log, or is over: it may come back at another size, but nothing else may.
      least = std::min(least, taken(held, fit_of(held, carried(held, m.effects), m.kappa).residual));
    }
    if ((window && m.effects.size() == 1) || alone)  // a window of anything fits
      least = std::min(least, std::max(0.0, shrink.fraction));
    return least;
  }

  /// Too little for so many: perhaps enough for fewer.
  void reduce(Judged& out) const {
    while (out.model.effects.size() > 1 && out.explained < needed(out.model)) {
      const auto least = std::min_element(out.shares.begin(), out.shares.end()) - out.shares.begin();
      GapModel smaller = choice_.search.evaluate(without(out.model.effects, static_cast<std::size_t>(least)),
                                                 out.model.kappa);
      Shrink shrink;
      const double here = explained(smaller, shrink);
      if (smaller.effects.size() == 1 && here < criteria_.least_of_fewer) break;
      out.model = std::move(smaller);
      out.explained = here;
      out.shrink = std::move(shrink);
      out.shares = shapley_shares(choice_.search, out.model, noise_);
    }
  }

  Verdict verdict(const Judged& out, double p_value) const {
    const GapModel& model = out.model;
    if (model.effects.empty()) {
      if (unexplained(model.fit.residual, model.kappa)) return Verdict::unexplained;
      return p_value <= criteria_.detection ? Verdict::not_detected : Verdict::no_gap;
    }
    if (out.explained < needed(model) || inexact(model, out.shares, 1.0 - out.explained))
      return unexplained(choice_.search.none(model.kappa).fit.residual, model.kappa) ? Verdict::unexplained
                                                                                     : Verdict::not_detected;
    return unexplained(model.fit.residual, model.kappa) && out.explained < criteria_.fully_explained
               ? Verdict::partly_explained
               : Verdict::explained;
  }

 private:
  double needed(const GapModel& m) const {
    return criteria_.least_explained(static_cast<int>(m.effects.size()));
  }
  bool unexplained(const Eigen::MatrixXd& residual, double kappa) const {
    return left_over(choice_.rows, residual, kappa > 0.0 ? options_.tolerance : 0.0, criteria_);
  }
  double taken(const GapRows& of, const Eigen::MatrixXd& residual) const {
    return std::clamp(shrink_fraction(of.y, residual, noise_), 0.0, 1.0);
  }

  /// More is left than the effects' forms can be blamed for, those that are not exact having taken `shares`
  /// of the gap, and on a joint of an exact one more than noise, whatever its colour, leaves on most:
  /// something else is there.
  bool inexact(const GapModel& model, const std::vector<double>& shares, double left) const {
    const Eigen::VectorXd ratio = rms(model.fit.residual).cwiseQuotient(choice_.rows.white_floor);
    std::vector<double> sorted(ratio.begin(), ratio.end());
    std::nth_element(sorted.begin(), sorted.begin() + ratio.size() / 2, sorted.end());
    const double usual = std::max(criteria_.floor_room, sorted[static_cast<std::size_t>(ratio.size() / 2)]);
    double blamed = criteria_.left_by_exact;
    bool more = false;
    for (std::size_t k = 0; k < model.effects.size(); ++k) {
      const Adopted& e = model.effects[k];
      if (e.h->approximate()) {
        blamed += shares[k];
        continue;
      }
      for (const UnitShape& u : e.units)
        for (const int j : u.block->channels) more = more || ratio[j] > criteria_.most_of_exact * usual;
    }
    return more && left > blamed;
  }

  const Choice& choice_;
  const Eigen::VectorXd& noise_;
  const DiagnoseOptions& options_;
  const Criteria& criteria_;
};

}  // namespace

Judged judge(const Choice& choice, const Eigen::VectorXd& noise, double p_value,
             const DiagnoseOptions& options) {
  const Judge by(choice, noise, options);
  Judged out;
  out.model = choice.model;
  out.explained = by.explained(out.model, out.shrink);
  out.shares = shapley_shares(choice.search, out.model, noise);
  by.reduce(out);
  out.windowed = has_window(out.model);
  out.within = out.windowed || (choice.split.alone && !out.model.effects.empty());
  out.verdict = by.verdict(out, p_value);
  return out;
}

}  // namespace dynid::detail
