// SPDX-License-Identifier: Apache-2.0
#include "servo_report.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "dynid/base/number.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/base/text.hpp"
#include "dynid/identification/servo_rollout.hpp"
#include "energy.hpp"

namespace dynid::detail {
namespace {

double interval_of(const Log& log) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < log.t.size(); ++i)
    if (log.t[i] > log.t[i - 1]) steps.push_back(log.t[i] - log.t[i - 1]);
  return steps.empty() ? 0.0 : median(std::move(steps));
}

Eigen::MatrixXd velocity(const Log& log) {
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(log.samples(), log.joints());
  for (Eigen::Index i = 1; i + 1 < log.samples(); ++i)
    if (log.t[i + 1] > log.t[i - 1])
      v.row(i) = (log.q.row(i + 1) - log.q.row(i - 1)) / (log.t[i + 1] - log.t[i - 1]);
  return v;
}

Judgement judged(const char* criterion, double value, double threshold, bool passed,
                 const std::string& text) {
  return {criterion, value, threshold, passed, text};
}

}  // namespace

void describe_servo_logs(const Robot& nominal, const std::vector<Log>& logs,
                         const std::vector<DataIssue>& issues, Diagnosis& d) {
  Answerable& a = d.answerable;
  const int n = nominal.size();
  a.joints.resize(static_cast<std::size_t>(n));
  a.channels = {"q", "u"};
  std::vector<double> travel(static_cast<std::size_t>(n), 0.0);
  std::vector<bool> commanded(static_cast<std::size_t>(n), false);
  bool any_dq = true;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Log& log = logs[l];
    PreparedLog prepared;
    prepared.source = log.source;
    prepared.report.samples = log.samples();
    const double interval = interval_of(log);
    prepared.report.rate_hz = 1.0 / interval;
    prepared.report.duration = log.t[log.samples() - 1] - log.t[0];
    prepared.report.columns = log.columns;
    for (const LogNote& note : log.notes)
      prepared.report.issues.push_back({note.name, note.joints, note.value, note.unit, note.text});
    for (const DataIssue& issue : issues)
      if (issue.text.rfind(log.source + ":", 0) == 0) prepared.report.issues.push_back(issue);
    a.duration += prepared.report.duration;
    a.rate_hz = l == 0 ? 1.0 / interval : std::min(a.rate_hz, 1.0 / interval);
    any_dq = any_dq && log.dq.size() > 0;
    const Eigen::MatrixXd v = velocity(log);
    for (int j = 0; j < n; ++j) {
      JointExcitation& e = a.joints[static_cast<std::size_t>(j)];
      e.travel = std::max(e.travel, log.q.col(j).maxCoeff() - log.q.col(j).minCoeff());
      e.speed = std::max(e.speed, v.col(j).cwiseAbs().maxCoeff());
      e.moving += double((v.col(j).array() != 0.0).count()) / double(log.samples()) / double(logs.size());
      double last = 0.0;
      for (Eigen::Index i = 1; i < log.samples(); ++i) {
        const double step = log.u(i, j) - log.u(i - 1, j);
        if (step == 0.0) continue;
        commanded[static_cast<std::size_t>(j)] = true;
        if (last * step < 0.0) ++e.reversals;
        last = step;
      }
    }
    d.logs.push_back(std::move(prepared));
  }
  if (any_dq) a.channels.emplace_back("dq");
  a.band_hz = 0.5 * a.rate_hz;
  d.cutoff = a.band_hz;
  for (int j = 0; j < n; ++j)
    if (!commanded[static_cast<std::size_t>(j)])
      a.blind.push_back({"joint_at_rest",
                         {j + 1},
                         "the command of joint " + std::to_string(j + 1) +
                             " never moves: of its servo an offset is all that shows; let it move"});
  const bool ratios = std::any_of(nominal.joints.begin(), nominal.joints.end(),
                                  [](const Joint& joint) { return !(joint.servo->kp > 0.0); });
  if (ratios)
    a.blind.push_back({"channel",
                       {},
                       "the model knows ratios to the stiffness only: payload, gravity compensation, springs "
                       "and friction with the load cannot be told; a model with kp and inertias would show "
                       "them"});
  a.blind.push_back({"channel",
                     {},
                     "no torque was recorded: damping of the servo and of the joint, and an offset of the "
                     "encoder and of the torque, are one each; currents or torques would part them"});
}

void fill_servo_series(const std::vector<Log>& logs, const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<Eigen::MatrixXd>& after,
                       const std::vector<std::vector<char>>& judging, Diagnosis& d) {
  Eigen::Index rows = 0;
  for (const Log& log : logs) rows += log.samples();
  GapSeries& s = d.series;
  s.t.resize(rows);
  s.before.resize(rows, d.rms.size());
  s.after.resize(rows, d.rms.size());
  Eigen::Index at = 0;
  for (std::size_t l = 0; l < logs.size(); ++l)
    for (Eigen::Index i = 0; i < logs[l].samples(); ++i, ++at) {
      s.log.push_back(static_cast<int>(l));
      s.t[at] = logs[l].t[i] - logs[l].t[0];
      s.before.row(at) = before[l].row(i);
      s.after.row(at) = after[l].row(i);
      s.held_out.push_back(judging[l][static_cast<std::size_t>(i)] != 0);
    }
}

void shrink_servo(const std::vector<Log>&, const std::vector<Eigen::MatrixXd>& before,
                  const std::vector<Eigen::MatrixXd>& after, const std::vector<std::vector<char>>& judging,
                  Diagnosis& d) {
  constexpr int draws = 200;
  constexpr Eigen::Index blocks_a_log = 20;
  std::vector<std::pair<Eigen::MatrixXd, Eigen::MatrixXd>> blocks;
  const Eigen::Index n = d.rms.size();
  Eigen::Index held = 0;
  for (std::size_t l = 0; l < before.size(); ++l) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < before[l].rows(); ++i)
      if (judging[l][static_cast<std::size_t>(i)] != 0) rows.push_back(i);
    held += static_cast<Eigen::Index>(rows.size());
    const auto size = static_cast<Eigen::Index>(rows.size());
    for (Eigen::Index b = 0; b < blocks_a_log; ++b) {
      const auto first = rows.begin() + size * b / blocks_a_log,
                 last = rows.begin() + size * (b + 1) / blocks_a_log;
      const std::vector<Eigen::Index> here(first, last);
      if (!here.empty()) blocks.emplace_back(before[l](here, Eigen::all), after[l](here, Eigen::all));
    }
  }
  const auto joined = [&](const std::vector<std::size_t>& which, bool later) {
    Eigen::Index rows = 0;
    for (const std::size_t k : which) rows += blocks[k].first.rows();
    Eigen::MatrixXd out(rows, n);
    Eigen::Index at = 0;
    for (const std::size_t k : which) {
      const Eigen::MatrixXd& block = later ? blocks[k].second : blocks[k].first;
      out.middleRows(at, block.rows()) = block;
      at += block.rows();
    }
    return out;
  };
  if (held == 0) return;
  std::vector<std::size_t> all(blocks.size());
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = k;
  const Eigen::MatrixXd b = joined(all, false), a = joined(all, true);
  d.shrink.before = rms(b);
  d.shrink.after = rms(a);
  d.shrink.floor = d.floor;
  d.shrink.fraction = shrink_fraction(b, a, d.floor);
  d.explained = d.shrink.fraction;
  std::mt19937_64 random(1);
  std::vector<double> fractions;
  for (int k = 0; k < draws; ++k) {
    std::vector<std::size_t> drawn;
    for (std::size_t i = 0; i < blocks.size(); ++i) drawn.push_back(random() % blocks.size());
    fractions.push_back(shrink_fraction(joined(drawn, false), joined(drawn, true), d.floor));
  }
  std::sort(fractions.begin(), fractions.end());
  d.shrink.low = std::min(d.shrink.fraction, fractions[draws / 20]);
  d.shrink.high = std::max(d.shrink.fraction, fractions[draws - 1 - draws / 20]);
}

void rank_servo_effects(const std::vector<ServoAnswer>& answers, Diagnosis& d) {
  std::map<std::string, RankedEffect> ranked;
  for (const std::string& name : servo_effect_names()) ranked[name] = {name, 0.0, 0.0};
  ranked["payload"] = {"payload", 0.0, 0.0};
  for (const ServoAnswer& a : answers) {
    for (const auto& [name, part] : a.choice.alone)
      ranked[name].explained = std::max(ranked[name].explained, part);
    for (const WeighedServoEffect& w : a.choice.effects)
      for (const auto& [difference, name] : w.rivals)  // its odds against the one that was taken
        ranked[name].probability =
            std::max(ranked[name].probability, 0.5 * std::exp(std::min(0.0, difference)));
  }
  for (const FoundEffect& e : d.effects) ranked[e.effect.name].probability = e.probability;
  for (const auto& [name, effect] : ranked) d.ranking.push_back(effect);
  std::stable_sort(d.ranking.begin(), d.ranking.end(), [](const RankedEffect& a, const RankedEffect& b) {
    return a.probability > b.probability;
  });
  for (const FoundEffect& e : d.effects) {
    ConsideredEffect considered;
    considered.name = e.effect.name;
    considered.joints = e.effect.joints;
    considered.share = e.share;
    considered.probability = e.probability;
    d.considered.push_back(considered);
  }
}

void servo_verdict(const ServoCriteria& c, Diagnosis& d) {
  const bool detected = d.p_value <= c.detection;
  d.judgement.push_back(judged("detection", d.p_value, c.detection, detected,
                               detected ? "the motion differs by more than noise and tolerance make"
                                        : "noise and tolerance may make such a difference of the motion"));
  if (!detected) {
    bool within = true;
    for (Eigen::Index j = 0; j < d.rms.size(); ++j)
      within = within && d.upper[j] <= 2.0 * d.tolerance[j] + d.floor[j];
    d.verdict = within ? Verdict::no_gap : Verdict::not_detected;
    return;
  }
  if (d.effects.empty()) {
    d.verdict = Verdict::unexplained;
    d.judgement.push_back(
        judged("effect_gain", 0.0, c.effect_gain, false,
               "no effect is likelier than not and lowers the motion error on data left out"));
    return;
  }
  double least = 1.0;
  for (const FoundEffect& e : d.effects) least = std::min(least, e.probability);
  bool left = false;
  double most_left = 0.0;
  for (Eigen::Index j = 0; j < d.rms.size(); ++j) {
    const double allowed = std::hypot(d.floor[j], d.tolerance[j]);
    most_left = std::max(most_left, d.shrink.after[j] / allowed);
    left = left || d.shrink.after[j] > c.left_over * allowed;
  }
  const double fraction = d.shrink.fraction;
  d.judgement.push_back(judged("least_shrink", fraction, c.least_shrink, fraction >= c.least_shrink,
                               "part of the motion error's energy that goes away on data left out"));
  d.judgement.push_back(
      judged("left_over", most_left, c.left_over, !left,
             "what is left there, in multiples of noise and tolerance, on the worst joint"));
  d.judgement.push_back(judged("least_probability", least, c.least_probability, least >= c.least_probability,
                               "least probability of an effect named"));
  if (least >= c.least_probability &&
      (fraction >= c.fully_explained || (fraction >= c.least_shrink && !left)))
    d.verdict = Verdict::explained;
  else if (fraction >= c.least_gain && d.shrink.low > 0.0)
    d.verdict = Verdict::partly_explained;
  else
    d.verdict = Verdict::unexplained;
}

Rollout servo_rollout(const Robot& nominal, const Robot& patched, const std::vector<Log>& logs,
                      const std::vector<std::vector<char>>& judging) {
  Rollout out;
  std::size_t l = logs.size() - 1;
  const Log& log = logs[l];
  const double interval = interval_of(log);
  out.log = static_cast<int>(l);
  // As a user of a simulator looks at it: a tenth of a second, half of one, one.
  const std::vector<double> horizons = {0.1, 0.5, 1.0};
  const auto length = static_cast<Eigen::Index>(std::lround(horizons.back() / interval));
  if (length < 2 || log.samples() <= length + 2) return out;
  std::vector<Eigen::Index> starts;
  for (Eigen::Index i = 1; i + length < log.samples(); i += length + 1)
    if (judging[l][static_cast<std::size_t>(i)] != 0 && judging[l][static_cast<std::size_t>(i + length)] != 0)
      starts.push_back(i);
  if (starts.empty()) return out;
  const Eigen::MatrixXd v = velocity(log);
  const Eigen::MatrixXd without = replay_servos_from(nominal, log, v, starts),
                        with = replay_servos_from(patched, log, v, starts);
  out.horizon = Eigen::Map<const Eigen::VectorXd>(horizons.data(), 3);
  out.before = out.after = Eigen::VectorXd::Zero(3);
  for (Eigen::Index k = 0; k < 3; ++k) {
    const auto steps = static_cast<Eigen::Index>(std::lround(out.horizon[k] / interval));
    std::vector<double> b, a;
    for (const Eigen::Index i : starts) {
      const double n = double(log.joints());
      b.push_back(std::sqrt((without.row(i + steps) - log.q.row(i + steps)).squaredNorm() / n));
      a.push_back(std::sqrt((with.row(i + steps) - log.q.row(i + steps)).squaredNorm() / n));
    }
    out.before[k] = median(std::move(b));
    out.after[k] = median(std::move(a));
  }
  const auto rows = static_cast<Eigen::Index>(starts.size()) * (length + 1);
  out.t.resize(rows);
  out.start.resize(rows);
  out.q.resize(rows, log.joints());
  out.without = out.with = out.q;
  Eigen::Index at = 0;
  for (std::size_t s = 0; s < starts.size(); ++s)
    for (Eigen::Index i = starts[s]; i <= starts[s] + length; ++i, ++at) {
      out.t[at] = log.t[i] - log.t[0];
      out.start[at] = static_cast<int>(s);
      out.q.row(at) = log.q.row(i);
      out.without.row(at) = without.row(i);
      out.with.row(at) = with.row(i);
    }
  return out;
}

void servo_next_experiment(Diagnosis& d) {
  std::vector<std::string> texts;
  bool any = false;
  for (const FoundEffect& e : d.effects)
    for (const std::string& alias : e.aliases) {
      d.next.separates.emplace_back(e.effect.name, alias);
      any = true;
    }
  const auto named = [&](const char* name) {
    return std::any_of(d.next.separates.begin(), d.next.separates.end(),
                       [&](const auto& pair) { return pair.first == name || pair.second == name; });
  };
  if (named("command_delay") || named("command_filter"))
    texts.emplace_back(
        "step the commands at rest: a delay is a dead time, a filter and damping are slow rises");
  if (named("backlash"))
    texts.emplace_back("turn round slowly under load and without: a gap does not open under load");
  if (named("payload") || named("gravity_compensation") || named("servo_stiffness"))
    texts.emplace_back("hold the arm still in poses of different load, with a known weight and without");
  if (named("torque_offset") || named("viscous_friction"))
    texts.emplace_back("record currents or torques beside the positions");
  if (d.verdict == Verdict::no_gap) {
    d.next.text = "None: the model moves as the robot does.";
    d.next.separates.clear();
  } else if (!texts.empty()) {
    d.next.text = capitalised(join(texts, "; ")) + ".";
  } else if (d.verdict == Verdict::unexplained || d.verdict == Verdict::not_detected) {
    d.next.text =
        "Record sweeps and steps of each joint by itself, fast and slow, and a log with the hand empty: what "
        "differs between them says where to look.";
  } else {
    d.next.text =
        any ? "Record steps and sweeps of each joint by itself." : "Replay further motions with the patch.";
  }
}

}  // namespace dynid::detail
