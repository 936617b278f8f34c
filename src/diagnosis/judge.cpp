// SPDX-License-Identifier: Apache-2.0
#include "judge.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynid/base/statistics.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "energy.hpp"
#include "held_out.hpp"
#include "shares.hpp"

namespace dynid::detail {
namespace {

class Judge {
 public:
  Judge(const Choice& choice, const GapRows& everything, const Eigen::VectorXd& noise,
        const DiagnoseOptions& options)
      : choice_(choice),
        // A window of a log alone was given its ends by all rows: all of them have it.
        around_(choice.split.several ? choice.rows : everything),
        noise_(noise),
        options_(options),
        criteria_(options.criteria) {}

  /// Least part of the gap that a model explains, where it was fitted and where it was not; `shrink` where
  /// that is found within the rows.
  double explained(const GapModel& m, Shrink& shrink) const {
    if (m.effects.empty()) return 0.0;
    const GapRows &rows = choice_.rows, &held = choice_.held;
    const bool window = has_window(m), alone = choice_.split.alone, held_judges = judged_in_held(m);
    double least = taken(rows, m.fit.residual);
    if (!held_judges && (window || alone)) shrink = shrink_within(around_, m, noise_, options_.seed);
    const auto left = [&](const Eigen::MatrixXd& y) -> Eigen::MatrixXd {
      return fit_terms(held, y, {}, m.kappa).residual;
    };
    if (held_judges || (alone && !has_once(m))) {
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
    if (held_judges) return least;
    if (window && m.effects.size() == 1)  // a window of anything fits
      least = std::min(least, std::max(0.0, shrink.fraction));
    else if (alone)
      least = std::min(least, std::max(0.0, explained_within(around_, m, noise_)));
    return least;
  }

  /// The rows held out judge all of the model: it comes back there or, what does not, goes on there.
  bool judged_in_held(const GapModel& m) const {
    if (choice_.split.alone) return false;
    for (std::size_t k = 0; k < m.effects.size(); ++k)
      if (m.effects[k].h->once() &&
          (choice_.split.several ||
           !shows(contribution(choice_.held, m, m.fit.theta, static_cast<std::ptrdiff_t>(k)),
                  own_contribution(m, k), noise_)))
        return false;
    return true;
  }

  /// Effects that may as well not be there, or that take nothing of the gap, are left out one by one, least
  /// probable first.
  void prune(Judged& out) const {
    while (out.model.effects.size() > 1) {
      std::size_t least = 0;
      double lowest = 1.0;
      for (std::size_t k = 0; k < out.model.effects.size(); ++k) {
        const double here = is_nothing(out, k) || below_form(choice_, out.model, k)
                                ? 0.0
                                : needed(choice_, out.model, k, calibration(options_));
        if (here < lowest) lowest = here, least = k;
      }
      if (lowest >= criteria_.least_probability) break;
      out.model = choice_.search.evaluate(without(out.model.effects, least), out.model.kappa);
      measure(out);
    }
  }

  /// The effect takes next to nothing of the gap, of all joints' and of each joint's own: a small effect on
  /// one joint is an answer there, however large the gap is on others. It is a hundredth of that joint's gap
  /// at least; where it is next to nothing of all of the gap, as much as a further effect has to matter.
  bool is_nothing(const Judged& out, std::size_t k) const {
    if (out.shares[k] >= criteria_.least_share) return false;
    const double least =
        out.shares[k] < 0.1 * criteria_.least_share ? criteria_.least_gain : criteria_.least_share;
    const Eigen::ArrayXd own = rms(own_contribution(out.model, k)).array(),
                         gap = rms(choice_.rows.y).array().max(criteria_.left_over * noise_.array());
    return (own / gap).square().maxCoeff() < least;
  }

  /// Weighs what is left, all of it together, and names of it what is more likely there than not, itself or
  /// what is as good in its place.
  void weigh(Judged& out) const {
    Ranked all = rank(choice_, out.model, out.shares, noise_, calibration(options_));
    for (std::size_t k = 0; all.better && k < out.model.effects.size(); ++k) {
      out.model = *std::move(all.better);
      measure(out);
      all = rank(choice_, out.model, out.shares, noise_, calibration(options_));
    }
    out.ranked.ranking = all.ranking;
    std::vector<Adopted> likely;
    std::vector<bool> sure(out.model.effects.size(), false);
    for (std::size_t k = 0; k < out.model.effects.size(); ++k) {
      const Adopted& e = out.model.effects[k];
      ConsideredEffect here{e.h->name(), {}, out.shares[k], all.grounds[k], all.probability[k]};
      for (const UnitShape& u : e.units)
        for (const int j : e.h->joints(choice_.rows.motions().front().robot(), u.unit))
          here.joints.push_back(j);
      out.considered.push_back(std::move(here));
      // A hundredth of the gap is as little as a gap within the tolerance: it has to be as sure.
      const double least = out.shares[k] < criteria_.least_share ? criteria_.least_probability_within
                                                                 : criteria_.least_probability;
      if (all.together[k] < least) {
        out.judgement.push_back({"least_probability", all.together[k], least, false,
                                 "probability of " + e.h->name() + ", which is therefore not named"});
        continue;
      }
      likely.push_back(e);
      sure[k] = true;
      out.ranked.probability.push_back(all.probability[k]);
      out.ranked.aliases.push_back(all.aliases[k]);
    }
    std::stable_sort(out.considered.begin(), out.considered.end(),
                     [](const ConsideredEffect& a, const ConsideredEffect& b) { return a.share > b.share; });
    if (likely.size() == out.model.effects.size()) return;
    const Judged all_of_it = out;
    out.model = choice_.search.evaluate(likely, out.model.kappa);
    measure(out);
    if (!likely.empty() && !answers(out) && is_the_story(all_of_it)) name_part(out, all_of_it, sure);
  }

  /// The effects of the model, with nothing beside them, take enough of the gap to be an answer.
  bool answers(const Judged& out) const {
    return out.explained >= criteria_.least_shrink && beyond_nominal(out.model) >= criteria_.least_shrink;
  }

  /// All of the gap is taken, also where nothing was chosen or fitted.
  bool is_the_story(const Judged& out) const {
    if (!answers(out) ||
        (out.explained < criteria_.fully_explained && unexplained(out.model.fit.residual, out.model.kappa)))
      return false;
    const Shrink shrink = judged_in_held(out.model) ? shrink_in_held(out.model, true) : out.shrink;
    return shrink.fraction >= criteria_.least_shrink;
  }

  /// A set is the whole story, and only some of it is sure. Those are named, with the sizes and shares that
  /// they have beside the others: that these take their part of the gap is certain, what they are is not.
  void name_part(Judged& out, const Judged& all_of_it, const std::vector<bool>& sure) const {
    const GapModel& whole = all_of_it.model;
    std::vector<std::string> names;
    std::vector<Eigen::Index> kept;  // of the coefficients
    out.model = whole;
    out.model.effects.clear();
    out.shares.clear();
    Eigen::Index at = 0;
    for (std::size_t k = 0; k < whole.effects.size(); ++k) {
      const Adopted& e = whole.effects[k];
      for (const UnitShape& u : e.units)
        for (Eigen::Index left = e.h->shape_only() ? 0 : u.block->size(); left > 0; --left, ++at)
          if (sure[k]) kept.push_back(at);
      if (sure[k]) {
        out.model.effects.push_back(e);
        out.shares.push_back(all_of_it.shares[k]);
        continue;
      }
      const Eigen::MatrixXd own = own_contribution(whole, k);
      out.model.fit.left += own;
      out.model.fit.residual += own;
      out.beside.push_back(e);
      names.push_back(e.h->name());
    }
    out.model.fit.theta = whole.fit.theta(kept).eval();
    out.explained = explained(out.model, out.shrink);
    out.judgement.push_back(
        {"set_explains", all_of_it.explained, criteria_.least_shrink, true,
         "part of the gap that the effects explain together with what is not sure enough to "
         "be named: " +
             join(names)});
  }

  /// What the model explains, and the shares of its effects.
  void measure(Judged& out) const {
    out.explained = explained(out.model, out.shrink);
    out.shares = shapley_shares(choice_.search, out.model, noise_);
  }

  Verdict verdict(Judged& out, const GapSize& size, double structure) const {
    const GapModel& model = out.model;
    const bool there = size.p_value <= criteria_.detection;
    say(out, "detection", size.p_value, criteria_.detection, there,
        there ? "the gap is larger than the tolerance and the noise make it"
              : "tolerance and noise make as large a gap");
    const double ratio = (size.upper.array() / size.tolerance.array().max(1e-300)).maxCoeff();
    say(out, "tolerance", ratio, 1.0, size.within(),
        size.within() ? "the upper limit of the gap is within the tolerance on every joint"
                      : "the upper limit of the gap is above the tolerance on a joint");
    const Verdict without_effects = size.within() ? Verdict::no_gap
                                    : there && unexplained(model_of_none(model), model.kappa)
                                        ? Verdict::unexplained
                                        : Verdict::not_detected;
    if (model.effects.empty()) {
      say(out, "structure", structure, criteria_.detection, structure <= criteria_.detection,
          "chance that a gap unrelated to the motion is explained as well by any effect");
      return without_effects;
    }
    const bool part = !out.beside.empty();  // of a set that was judged
    const bool enough = out.explained >= criteria_.least_shrink;
    say(out, "least_explained", out.explained, criteria_.least_shrink, enough,
        "part of the gap that the effects explain, where they were fitted and where they were not");
    const double beyond = beyond_nominal(model);
    const bool effects_do = beyond >= criteria_.least_shrink;
    say(out, "beyond_nominal", beyond, criteria_.least_shrink, effects_do,
        "part that the effects explain of what errors of the nominal model alone leave");
    if (!part && (!enough || !effects_do)) return without_effects;
    const bool left = unexplained(model.fit.residual, model.kappa);
    say(out, "fully_explained", out.explained, criteria_.fully_explained,
        !left || out.explained >= criteria_.fully_explained,
        left ? "what is left is above the noise" : "what is left is within the noise");
    const double least = *std::min_element(out.ranked.probability.begin(), out.ranked.probability.end());
    const bool sure = least >= criteria_.least_probability,
               shrinks = out.shrink.fraction >= criteria_.least_shrink;
    say(out, "least_probability", least, criteria_.least_probability, sure,
        "probability of the least sure effect within the set");
    say(out, "least_shrink", out.shrink.fraction, criteria_.least_shrink, shrinks,
        "part by which the gap shrinks on data that neither chose nor fitted anything");
    if (!(out.shrink.fraction > 0.0) && !has_once(model)) {
      // Effects that the nominal's own errors work against enlarge the gap when they are taken out of it, and
      // are there none the less. Of a gap that those errors may be alone that says nothing.
      if (!(model.kappa > 0.0) || !enough || !effects_do || !there || size.within() ||
          least < criteria_.least_probability_within)
        return without_effects;
      say(out, "nominal_opposes", model.kappa, 0.0, true,
          "the model's own parameters are off by about this part, and work against the effects: the gap does "
          "not shrink by these alone");
    }
    // What may be no gap at all has to be as sure as what is within the tolerance.
    if ((size.within() || !there) && least < criteria_.least_probability_within) return without_effects;
    return part || (left && out.explained < criteria_.fully_explained) || !sure || !shrinks
               ? Verdict::partly_explained
               : Verdict::explained;
  }

  Shrink shrink_in_held(const GapModel& model, bool adopted) const {
    const GapRows& held = choice_.held;
    const Eigen::MatrixXd rest =
        adopted ? Eigen::MatrixXd(held.y - contribution(held, model, model.fit.theta)) : held.y;
    return shrink_of(held, rest, noise_, options_.seed);
  }

 private:
  bool unexplained(const Eigen::MatrixXd& residual, double kappa) const {
    return left_over(choice_.rows, residual, kappa > 0.0 ? options_.tolerance : 0.0, criteria_);
  }
  double taken(const GapRows& of, const Eigen::MatrixXd& residual) const {
    return std::clamp(shrink_fraction(of.y, residual, noise_), 0.0, 1.0);
  }

  static void say(Judged& out, const char* criterion, double value, double threshold, bool passed,
                  const char* text) {
    out.judgement.push_back({criterion, value, threshold, passed, text});
  }
  /// Where the nominal's errors alone explain most of the gap, little is left for effects to be right about.
  double beyond_nominal(const GapModel& model) const {
    const double alone = taken(choice_.rows, model_of_none(model)),
                 with = taken(choice_.rows, model.fit.residual);
    return alone < 1.0 ? (with - alone) / (1.0 - alone) : 1.0;
  }
  Eigen::MatrixXd model_of_none(const GapModel& model) const {
    return choice_.search.none(model.kappa).fit.residual;
  }

  const Choice& choice_;
  const GapRows& around_;
  const Eigen::VectorXd& noise_;
  const DiagnoseOptions& options_;
  const Criteria& criteria_;
};

}  // namespace

Judged judge(const Choice& choice, const GapRows& everything, const Eigen::VectorXd& noise,
             const GapSize& size, double structure_p_value, const DiagnoseOptions& options) {
  const Judge by(choice, everything, noise, options);
  Judged out;
  out.model = choice.model;
  by.measure(out);
  by.prune(out);
  by.weigh(out);
  out.windowed = has_window(out.model);
  out.within =
      !by.judged_in_held(out.model) && (out.windowed || (choice.split.alone && !out.model.effects.empty()));
  if (!out.within) out.shrink = by.shrink_in_held(out.model, true);
  out.verdict = by.verdict(out, size, structure_p_value);
  if (!out.within && !adopts(out.verdict)) out.shrink = by.shrink_in_held(out.model, false);
  return out;
}

}  // namespace dynid::detail
