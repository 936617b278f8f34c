// SPDX-License-Identifier: Apache-2.0
//
// `dynid-diagnosis-1`: one function for each part of it.
#include <cmath>
#include "app/serialise.hpp"

#include "diagnosis/joint_shrink.hpp"
#include "dynid/diagnosis/servo_diagnose.hpp"

namespace dynid {
namespace {

constexpr unsigned shrink_seed = 1;  // of the blocks drawn: the same for every report

nlohmann::json values_json(const Eigen::VectorXd& x) {
  if (x.size() == 1) return x[0];
  return to_json(x);
}

nlohmann::json estimate_json(const ParameterEstimate& p) {
  return {{"value", values_json(p.value)},
          {"low", values_json(p.low)},
          {"high", values_json(p.high)},
          {"unit", p.unit},
          {"per_joint", p.per_joint}};
}

nlohmann::json effect_json(const FoundEffect& found) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const ParameterEstimate& p : found.parameters) parameters[p.key] = estimate_json(p);
  return {{"name", found.effect.name},        {"joints", found.effect.joints}, {"share", found.share},
          {"probability", found.probability}, {"aliases", found.aliases},      {"parameters", parameters}};
}

nlohmann::json effects_json(const Diagnosis& d) {
  nlohmann::json effects = nlohmann::json::array();
  for (const FoundEffect& e : d.effects) effects.push_back(effect_json(e));
  return effects;
}

nlohmann::json where_json(const Diagnosis& d) {
  nlohmann::json where = nlohmann::json::array();
  for (const GapCell& c : d.where)
    where.push_back({{"joint", c.joint}, {"regime", c.regime}, {"share", c.share}, {"p_value", c.p_value}});
  return where;
}

nlohmann::json windows_json(const Diagnosis& d) {
  nlohmann::json windows = nlohmann::json::array();
  for (const GapWindow& w : d.windows)
    windows.push_back({{"log", w.log}, {"t0", w.t0}, {"t1", w.t1}, {"joints", w.joints}});
  return windows;
}

nlohmann::json visible_json(const Diagnosis& d) {
  nlohmann::json visible = nlohmann::json::array();
  for (const VisibleSize& v : d.smallest_visible)
    visible.push_back({{"name", v.name}, {"joint", v.joint}, {"torque_rms", v.torque_rms}});
  return visible;
}

nlohmann::json judgement_json(const Diagnosis& d) {
  nlohmann::json judgement = nlohmann::json::array();
  for (const Judgement& j : d.judgement)
    judgement.push_back({{"criterion", j.criterion},
                         {"value", j.value},
                         {"threshold", j.threshold},
                         {"passed", j.passed},
                         {"text", j.text}});
  return judgement;
}

/// All that was weighed, named or not.
nlohmann::json considered_json(const Diagnosis& d) {
  nlohmann::json considered = nlohmann::json::array();
  for (const ConsideredEffect& e : d.considered)
    considered.push_back(
        {{"name", e.name}, {"joints", e.joints}, {"probability", e.probability}, {"share", e.share}});
  return considered;
}

nlohmann::json gap_json(const Diagnosis& d) {
  return {{"rms", to_json(d.rms)},
          {"floor", to_json(d.floor)},
          {"unit", d.unit},
          {"p_value", d.p_value},
          {"structure_p_value", d.structure_p_value},
          {"upper", to_json(d.upper)},
          {"tolerance", to_json(d.tolerance)},
          {"where", where_json(d)},
          {"windows", windows_json(d)},
          {"smallest_visible", visible_json(d)}};
}

nlohmann::json answerable_json(const Answerable& a) {
  nlohmann::json joints = nlohmann::json::array(), blind = nlohmann::json::array();
  for (const JointExcitation& e : a.joints)
    joints.push_back({{"travel", e.travel},
                      {"speed", e.speed},
                      {"moving", e.moving},
                      {"reversals", e.reversals},
                      {"load", e.load},
                      {"swing", e.swing}});
  for (const Blindness& b : a.blind)
    blind.push_back({{"name", b.name}, {"joints", b.joints}, {"text", b.text}});
  return {{"duration_s", a.duration}, {"rate_hz", a.rate_hz}, {"band_hz", a.band_hz},
          {"channels", a.channels},   {"joints", joints},     {"not_seen", blind}};
}

nlohmann::json data_json(const Diagnosis& d) {
  nlohmann::json data = to_json(d.logs);
  data["answerable"] = answerable_json(d.answerable);
  data["conventions"] = conventions_json(d.conventions);
  data["equivalent_readings"] = d.conventions.equivalents;
  data["undecided_readings"] = d.conventions.undecided;
  data["logs"] = nlohmann::json::array();
  for (const PreparedLog& log : d.logs)
    data["logs"].push_back({{"log", log.source},
                            {"samples", log.report.samples},
                            {"rate_hz", log.report.rate_hz},
                            {"duration_s", log.report.duration}});
  return data;
}

nlohmann::json ranking_json(const Diagnosis& d) {
  nlohmann::json ranking = nlohmann::json::array();
  for (const RankedEffect& r : d.ranking)
    ranking.push_back({{"name", r.name}, {"probability", r.probability}, {"explained", r.explained}});
  return ranking;
}

nlohmann::json rollout_json(const Rollout& rollout) {
  return {{"horizon_s", to_json(rollout.horizon)},
          {"before", to_json(rollout.before)},
          {"after", to_json(rollout.after)}};
}

/// A joint without a gap has no part of it that goes: null, as JSON has no other word for it.
nlohmann::json known_json(const Eigen::VectorXd& x) {
  nlohmann::json out = nlohmann::json::array();
  for (const double value : x) out.push_back(std::isfinite(value) ? nlohmann::json(value) : nlohmann::json());
  return out;
}

nlohmann::json joint_shrink_json(const Diagnosis& d) {
  const detail::JointShrink s = detail::joint_shrink(d.series, d.floor, shrink_seed);
  return {{"before", to_json(s.before)},
          {"after", to_json(s.after)},
          {"fraction", known_json(s.fraction)},
          {"low", known_json(s.low)},
          {"high", known_json(s.high)}};
}

nlohmann::json shrink_json(const Diagnosis& d) {
  return {{"before", to_json(d.shrink.before)},
          {"after", to_json(d.shrink.after)},
          {"floor", to_json(d.shrink.floor)},
          {"fraction", d.shrink.fraction},
          {"low", d.shrink.low},
          {"high", d.shrink.high},
          {"held_out", d.shrink.held_out},
          {"joints", joint_shrink_json(d)},
          {"rollout", rollout_json(d.rollout)}};
}

nlohmann::json next_json(const NextExperiment& next) {
  nlohmann::json separates = nlohmann::json::array();
  for (const auto& [a, b] : next.separates) separates.push_back({a, b});
  return {{"text", next.text}, {"separates", separates}, {"trajectory", nullptr}};
}

}  // namespace

nlohmann::json to_json(const DiagnoseReport& report) {
  const Diagnosis& d = report.diagnosis;
  return {{"format", "dynid-diagnosis-1"},
          {"data", data_json(d)},
          {"gap", gap_json(d)},
          {"verdict", to_string(d.verdict)},
          {"effects", effects_json(d)},
          {"ranking", ranking_json(d)},
          {"considered", considered_json(d)},
          {"judgement", judgement_json(d)},
          {"shrink", shrink_json(d)},
          {"next_experiment", next_json(d.next)},
          {"nominal_error", d.nominal_error},
          {"explained", d.explained},
          {"cutoff_hz", d.cutoff},
          {"quantity", of_motion(d) ? "motion" : "torque"},
          {"view", report.referenced ? "B" : "A"},
          {"seconds", d.seconds}};
}

}  // namespace dynid
