// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/diagnose.hpp"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/effect/enter.hpp"
#include "energy.hpp"
#include "gap_size.hpp"
#include "gap_test.hpp"
#include "held_out.hpp"
#include "intervals.hpp"
#include "judge.hpp"
#include "next_experiment.hpp"
#include "rank.hpp"
#include "rollout.hpp"
#include "select.hpp"
#include "series.hpp"
#include "spread.hpp"
#include "surrogates.hpp"
#include "unusable.hpp"
#include "where.hpp"

namespace dynid {
namespace {

using namespace detail;

void check(const Robot& nominal, const std::vector<Log>& logs) {
  if (logs.empty()) throw Error("diagnosis: no log");
  for (const Log& log : logs)
    if (log.joints() != nominal.size())
      throw Error(log.source + ": " + std::to_string(log.joints()) + " joints, the model has " +
                  std::to_string(nominal.size()));
}

/// The band that all logs are looked at in: wide enough for the corners of friction, where the sampling
/// allows it.
PrepareOptions band_of(const std::vector<Log>& logs, double cutoff) {
  PrepareOptions options;
  options.speed_cutoff = speed_band;
  options.cutoff = cutoff;
  if (cutoff != 0.0) return options;
  options.cutoff = 10.0;
  for (const Log& log : logs) options.cutoff = std::min(options.cutoff, std::max(8.0, choose_cutoff(log)));
  for (const Log& log : logs) {
    const double rate = double(log.samples() - 1) / std::max(1e-9, log.t[log.samples() - 1] - log.t[0]);
    options.cutoff = std::min(options.cutoff, rate / 6.0);
  }
  return options;
}

std::vector<const Hypothesis*> library_of(const DiagnoseOptions& options) {
  std::vector<const Hypothesis*> library;
  for (const auto& h : hypotheses())
    if (std::find(options.withhold.begin(), options.withhold.end(), h->name()) == options.withhold.end())
      library.push_back(h.get());
  library.insert(library.end(), options.extra.begin(), options.extra.end());
  return library;
}

/// The answer where the data cannot carry one.
void refuse(const GapRows& everything, const std::vector<bool>& held_out, Verdict verdict, Diagnosis& out) {
  out.verdict = verdict;
  out.shrink.before = out.shrink.after = out.rms;
  out.shrink.floor = out.floor;
  out.upper = out.rms;
  out.tolerance = Eigen::VectorXd::Zero(out.rms.size());
  out.series = {everything.log, everything.t, everything.y, everything.y, held_out};
  for (const auto& h : hypotheses())
    if (out.ranking.empty() || out.ranking.back().name != h->name()) out.ranking.push_back({h->name()});
}

/// Says of each convention by which figures it was told.
void judge_reading(const ConventionReport& report, Diagnosis& out) {
  for (const Convention& c : report.conventions)
    out.judgement.push_back({c.name, c.explained_after, c.explained_before, false, c.text});
  out.next.text = "Read the log as it is meant: --assume " + report.assume + " (or --assume auto).";
}

/// Fitted over all rows, an effect may be what none can be on a joint where it is next to nothing: it is left
/// out there, unless it is nowhere anything else.
void leave_out_impossible(const Choice& choice, const GapRows& rows, GapModel& model) {
  bool changed = false;
  Eigen::Index at = 0;
  for (Adopted& e : model.effects) {
    std::vector<UnitShape> possible;
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      const Eigen::VectorXd c =
          p > 0 ? Eigen::VectorXd(model.fit.theta.segment(at, p)) : Eigen::VectorXd::Ones(1);
      if (choice.search.plausible(*e.h, u.unit, c, u.shape)) possible.push_back(u);
      at += p;
    }
    if (possible.empty() || possible.size() == e.units.size()) continue;
    e.units = std::move(possible);
    changed = true;
  }
  if (changed) model.fit = fit_of(rows, model.effects, model.kappa);
}

/// The effects that are named, with their intervals, over all rows that show them.
std::vector<FoundEffect> named(const Robot& nominal, const GapRows& everything, const Choice& choice,
                               const Judged& judged, const DiagnoseOptions& options) {
  const bool where_found =
      judged.windowed && (choice.split.several || everything.size() > options.criteria.searched_rows);
  const GapRows& whole = where_found ? choice.rows : everything;
  GapModel model = judged.model;
  model.effects.insert(model.effects.end(), judged.beside.begin(), judged.beside.end());
  model.effects = carried(whole, model.effects);
  model.fit = fit_of(whole, model.effects, model.kappa);
  leave_out_impossible(choice, whole, model);
  std::vector<FoundEffect> out;
  for (const std::size_t k : by_share(judged.shares)) {
    out.push_back(found_effect(nominal, whole, model, k, options.seed + static_cast<unsigned>(k),
                               calibration(options)));
    out.back().probability = judged.ranked.probability[k];
    out.back().aliases = judged.ranked.aliases[k];
    out.back().share = judged.shares[k];
  }
  return out;
}

/// The diagnosis of the logs as find_conventions() reads them.
Diagnosis diagnose_as_read(const Robot& nominal, const std::vector<Log>& logs, DiagnoseOptions options,
                           const ConventionReport& conventions) {
  const Assumptions assumed = parse_assumptions(conventions.assume, nominal.size());
  const Robot mounted = apply_conventions(assumed, nominal);
  std::vector<Log> read;
  read.reserve(logs.size());
  for (const Log& log : logs) read.push_back(apply_conventions(assumed, mounted, log));
  options.reading = Reading::trust;
  Diagnosis out = diagnose(mounted, read, options);
  out.conventions = conventions;
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
    case Verdict::misread:
      return "misread";
    case Verdict::data_invalid:
      break;
  }
  return "data_invalid";
}

Diagnosis diagnose(const Robot& given, const std::vector<Log>& logs, const DiagnoseOptions& options) {
  const auto began = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  };
  const Say say = [&](const char* stage, double fraction) {
    if (options.progress) options.progress(stage, fraction);
  };
  check(given, logs);
  // What the model says of effects is part of its torque: what is sought is what it does not say.
  const Robot nominal = with_effects_entered(given, Entering::everything);
  Diagnosis out;
  say("checking the data", 0.0);
  if (options.reading != Reading::trust) out.conventions = find_conventions(nominal, logs);
  if (options.reading == Reading::apply && !out.conventions.conventions.empty())
    return diagnose_as_read(nominal, logs, options, out.conventions);
  const PrepareOptions band = band_of(logs, options.cutoff);
  out.cutoff = band.cutoff;
  for (const Log& log : logs) out.logs.push_back(prepare(log, band));

  say("nominal model", 0.05);
  std::vector<DataIssue> invalid = unusable(logs, out.logs, joint_scales(nominal));
  out.answerable = can_answer(nominal, logs, out.logs);
  if (const std::vector<std::string> outside = outside_family(calibration(options), logs); !outside.empty())
    out.logs.front().report.issues.push_back(
        {"outside_calibration",
         {},
         double(outside.size()),
         "1",
         "outside the arms and logs that the probabilities were calibrated on: " + join(outside)});
  GapRows everything(nominal, out.logs);
  everything.allow_for_colour(logs, 1.0 / options.criteria.left_over);  // all of it is then noise
  const int count = static_cast<int>(logs.size());
  const bool longer = everything.size() > options.criteria.searched_rows;
  // Effects are sought in a spread of windows, and judged on all rows.
  GapRows spread = longer ? GapRows(everything, spread_windows(everything, options.criteria)) : everything;
  const Split parts = split(spread, count, options.tolerance, options.criteria);
  out.rms = rms(everything.y);
  out.floor = everything.white_floor;
  for (const Joint& joint : nominal.joints) out.unit.push_back(joint_units(joint.type).torque);
  if (!out.conventions.conventions.empty()) {
    refuse(everything, over_all(everything, count, spread, parts).to_judge, Verdict::misread, out);
    judge_reading(out.conventions, out);
    out.seconds = seconds();
    return out;
  }
  if (invalid.empty()) invalid = too_short(spread, parts, logs.front().source, count);
  if (!invalid.empty()) {
    std::vector<DataIssue>& issues = out.logs.front().report.issues;
    issues.insert(issues.begin(), invalid.begin(), invalid.end());
    refuse(everything, over_all(everything, count, spread, parts).to_judge, Verdict::data_invalid, out);
    out.next.text = "Record again: " + invalid.front().text + ".";
    out.seconds = seconds();
    return out;
  }

  const std::vector<const Hypothesis*> library = library_of(options);
  GapRows moving = spread.moving(options.criteria.at_rest);
  const std::unique_ptr<Choice> choice = select(moving, parts, library, options, say);
  everything = everything.late(moving.lateness());
  std::unique_ptr<Choice> over_all_rows;
  if (longer) {
    moving = everything.moving(options.criteria.at_rest);
    everything.nuisance.clear();  // a copy is enough
    over_all_rows =
        std::make_unique<Choice>(moving, over_all(everything, count, spread, choice->split), *choice);
  }
  const Choice& judged_on = longer ? *over_all_rows : *choice;
  const GapRows& rows = choice->rows;
  const GapModel none = choice->search.none(choice->model.kappa);
  out.nominal_error = choice->model.kappa;

  say("surrogates", 0.7);
  tbb::parallel_invoke(
      [&] {
        out.structure_p_value =
            structure_p_value(rows, choice->search.blocks(), none.fit.residual,
                              surrogates(rows, none.fit.residual, options.surrogates, options.seed));
      },
      [&] {  // where a joint sticks is a place of the gap too
        out.where = locate(spread, everything.white_floor,
                           surrogates(spread, spread.y, options.surrogates, options.seed));
      });
  // The floor: white noise, or what is left where that is coloured; not what no effect explains.
  const Eigen::VectorXd residual = rms(choice->model.fit.residual);
  out.floor = residual.cwiseMin(options.criteria.floor_room * rows.white_floor).cwiseMax(rows.white_floor);

  // Whether there is a gap is asked of all that may be coloured noise; what is explained of it, of less.
  const Eigen::VectorXd coloured =
      residual.cwiseMin(options.criteria.floor_room * rows.coloured_floor).cwiseMax(out.floor);
  const GapSize size = gap_size(moving, coloured, options.tolerance, options.criteria);
  out.p_value = size.p_value;
  out.upper = size.upper;
  out.tolerance = size.tolerance;

  say("alternatives", 0.8);
  const Judged judged = judge(judged_on, moving, out.floor, size, out.structure_p_value, options);
  out.explained = judged.explained;
  out.verdict = judged.verdict;
  out.judgement = judged.judgement;
  out.considered = judged.considered;
  if (out.verdict == Verdict::no_gap || out.verdict == Verdict::not_detected)
    out.smallest_visible = choice->search.smallest_visible(none);

  choice->search.end();
  if (over_all_rows != nullptr) over_all_rows->search.end();

  out.ranking = judged.ranked.ranking;
  out.shrink = judged.shrink;
  say("intervals", 0.95);
  if (adopts(out.verdict)) out.effects = named(nominal, moving, judged_on, judged, options);
  std::vector<std::string> names;
  names.reserve(logs.size());
  for (const Log& log : logs) names.push_back(log.source);
  put_series(nominal, everything, judged_on, judged, names, out);
  if (options.replay) {
    say("replaying the motion", 0.97);
    out.rollout =
        roll_out(everything.motions().front().robot(), out.effects, everything, judged_on.split.to_judge);
    out.next = next_experiment(nominal, out);
  }
  out.seconds = seconds();
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
