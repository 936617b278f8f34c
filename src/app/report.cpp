// SPDX-License-Identifier: Apache-2.0
//
// The page of a diagnosis: its JSON, put into words for the templates of src/app/page/. What no JSON has is
// drawn here: the gap over time and the replay.
#include "dynid/app/report.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "app/serialise.hpp"
#include "base/page.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/servo_diagnose.hpp"
#include "report_plots.hpp"
#include "report_view.hpp"
#include "report_words.hpp"

namespace dynid {
namespace {

using nlohmann::json;
using namespace detail;

constexpr double least_ranked = 0.001;  // probability below which an effect has no bar
constexpr std::size_t long_sentence = 120;

/// Badge and tone of each verdict.
std::pair<const char*, const char*> badge(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_gap:
      return {"No gap", "good"};
    case Verdict::not_detected:
      return {"Nothing detected", "calm"};
    case Verdict::explained:
      return {"Explained", "good"};
    case Verdict::partly_explained:
      return {"Partly explained", "warn"};
    case Verdict::unexplained:
      return {"Unexplained", "bad"};
    case Verdict::misread:
      return {"Log misread", "bad"};
    case Verdict::data_invalid:
      break;
  }
  return {"Data not usable", "bad"};
}

std::string unit_of_joint(const json& json_of, std::size_t joint) {
  const json& units = json_of.at("gap").at("unit");
  return joint < units.size() ? units.at(joint).get<std::string>() : "N m";
}

/// Joints from 0, those with the largest value first.
std::vector<std::size_t> largest_first(const std::vector<double>& x) {
  std::vector<std::size_t> order(x.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return x[a] > x[b]; });
  return order;
}

/// The largest gap in units of their floor.
std::vector<std::size_t> worst_joints(const json& json_of) {
  std::vector<double> x = json_of.at("gap").at("rms");
  const std::vector<double> before = json_of.at("shrink").at("before"), floor = json_of.at("gap").at("floor");
  if (before.size() == x.size()) x = before;
  for (std::size_t j = 0; j < x.size(); ++j) x[j] /= floor[j];
  return largest_first(x);
}

/// Which log judges, and whether all of it does: of one log parts do.
struct JudgedLog {
  int log = 0;
  bool whole = false;
  explicit JudgedLog(const Diagnosis& d) : whole(d.logs.size() > 1) {
    const GapSeries& s = d.series;
    for (std::size_t i = 0; i < s.held_out.size(); ++i)
      if (s.held_out[i]) log = s.log[i];
    for (std::size_t i = 0; i < s.held_out.size(); ++i)
      if (s.log[i] == log && !s.held_out[i]) whole = false;
  }
};

json figures_view(const json& json_of, std::size_t worst) {
  json figures = json::array();
  const json &effects = json_of.at("effects"), &shrink = json_of.at("shrink"), &gap = json_of.at("gap");
  if (!effects.empty()) {
    figures.push_back({{"value", page_percent(shrink.at("fraction"))},
                       {"text", "of the gap goes away on data not used (" +
                                    page_percents(shrink.at("low"), shrink.at("high")) + ")"}});
    const json& first = effects.front();
    figures.push_back({{"value", page_probability(first.at("probability"))},
                       {"text", "probability of " + with_spaces(first.at("name"))}});
  }
  if (worst < gap.at("rms").size()) {
    const double rms = gap.at("rms").at(worst), times = rms / gap.at("floor").at(worst).get<double>();
    figures.push_back(
        {{"value", page_number(rms) + "\u00a0" + unit_of_joint(json_of, worst)},
         {"text", "rms gap of joint " + std::to_string(worst + 1) + ", " +
                      page_number(times, times < 10.0 ? "%.1f" : "%.0f") + " times its floor"}});
  }
  const json& replay = shrink.at("rollout");
  if (const std::size_t horizons = replay.at("horizon_s").size(); horizons > 0) {
    const std::size_t k = horizons / 2;
    const std::string before = page_angle(replay.at("before").at(k)),
                      after = page_angle(replay.at("after").at(k));
    figures.push_back({{"value", before + (effects.empty() ? "" : " \u2192 " + after)},
                       {"text", "error of the motion after " + page_number(replay.at("horizon_s").at(k)) +
                                    " s of replay"}});
  }
  figures.push_back({{"value", page_number(gap.at("p_value"), "%.2g")},
                     {"text", "p-value: chance of such a gap from noise and tolerance alone"}});
  return figures;
}

json residual_view(const Diagnosis& d, const json& json_of, const JudgedLog& held, const PlotGroup& plots,
                   const std::vector<std::string>& files) {
  const auto log = static_cast<std::size_t>(held.log);
  json view = {{"rows", d.series.t.size() > 0},
               {"motion", of_motion(d)},
               {"cutoff", page_number(json_of.at("cutoff_hz"))},
               {"whole_log", held.whole},
               {"log", log < files.size() ? files[log] : ""}};
  view.update(plots_view(plots));
  return view;
}

json shrink_view(const json& json_of) {
  const json &shrink = json_of.at("shrink"), &of = shrink.at("joints"),
             &floor = json_of.at("gap").at("floor");
  const bool adopted = !json_of.at("effects").empty();
  json joints = json::array();
  std::vector<std::string> units;
  for (std::size_t j = 0; j < of.at("before").size(); ++j) {
    const json& part = of.at("fraction").at(j);
    const bool known = adopted && part.is_number();
    json row = {{"joint", j + 1},
                {"before", page_number(of.at("before").at(j))},
                {"after", page_number(of.at("after").at(j))},
                {"floor", page_number(floor.at(j))},
                {"gap", known},
                {"no_gap", adopted && !known}};
    if (row.at("gap")) {
      const double fraction = part, low = of.at("low").at(j), high = of.at("high").at(j);
      const double left = std::clamp(low, 0.0, 1.0), right = std::clamp(high, 0.0, 1.0);
      row["fraction"] = page_percent(fraction);
      row["interval"] = page_percents(low, high);
      row["left"] = short_number(100.0 * left, 5);
      row["width"] = short_number(std::max(0.5, 100.0 * (right - left)), 5);
      row["at"] = short_number(100.0 * std::clamp(fraction, 0.0, 1.0), 5);
    }
    joints.push_back(std::move(row));
    const std::string unit = unit_of_joint(json_of, j);
    if (std::find(units.begin(), units.end(), unit) == units.end()) units.push_back(unit);
  }
  return {{"adopted", adopted},
          {"fraction", page_percent(shrink.at("fraction"))},
          {"interval", page_percents(shrink.at("low"), shrink.at("high"))},
          {"joints", joints},
          {"motion", json_of.at("quantity") == "motion"},
          {"unit", join(units, " or ")}};
}

/// The joints that the nominal model carries off most are drawn first; a light one may run far away.
PlotGroup replay_group(const Rollout& r) {
  if (r.horizon.size() == 0 || r.t.size() == 0) return {};
  const Eigen::VectorXd off = (r.without - r.q).cwiseAbs().cwiseMin(1.0).colwise().mean().transpose();
  return replay_plots(r, largest_first({off.data(), off.data() + off.size()}));
}

json replay_view(const Diagnosis& d, const json& json_of, const PlotGroup& plots) {
  const json& replay = json_of.at("shrink").at("rollout");
  json horizons = json::array();
  for (std::size_t k = 0; k < replay.at("horizon_s").size(); ++k)
    horizons.push_back({{"horizon", page_number(replay.at("horizon_s").at(k))},
                        {"before", page_angle(replay.at("before").at(k))},
                        {"after", page_angle(replay.at("after").at(k))}});
  json view = {{"any", !horizons.empty()}, {"motion", of_motion(d)}, {"horizons", horizons}};
  view.update(plots_view(plots));
  return view;
}

void add_ranking_view(const json& json_of, json& view) {
  view["ranking"] = json::array();
  std::vector<std::string> below;
  for (const json& r : json_of.at("ranking")) {
    const double p = r.at("probability");
    const std::string name = with_spaces(r.at("name"));
    if (p < least_ranked) {
      below.push_back(name);
      continue;
    }
    const json& effects = json_of.at("effects");
    const bool adopted = std::any_of(effects.begin(), effects.end(),
                                     [&](const json& e) { return e.at("name") == r.at("name"); });
    view["ranking"].push_back({{"name", name},
                               {"adopted", adopted},
                               {"width", short_number(100.0 * p, 5)},
                               {"probability", page_probability(p)}});
  }
  view["any_ranking"] = !view["ranking"].empty();
  view["below"] = list_in_words(below);
}

json logs_view(const json& json_of, const JudgedLog& held, const std::vector<std::string>& files) {
  const json& data = json_of.at("data");
  const auto n = static_cast<Eigen::Index>(json_of.at("gap").at("rms").size());
  const std::string cutoff = page_number(json_of.at("cutoff_hz"));
  json logs = json::array();
  for (std::size_t l = 0; l < data.at("logs").size(); ++l) {
    const json& log = data.at("logs").at(l);
    json issues = json::array();
    for (const json& issue : data.at("issues")) {
      if (issue.at("log") != log.at("log")) continue;
      const std::string where = joints_in_words(issue.at("joints"), n);
      issues.push_back({{"name", capitalised(with_spaces(issue.at("name")))},
                        {"where", where.empty() ? "" : " (" + where + ")"},
                        {"text", issue.at("text")}});
    }
    const bool judges = static_cast<int>(l) == held.log;
    logs.push_back({{"file", l < files.size() ? files[l] : log.at("log").get<std::string>()},
                    {"samples", log.at("samples")},
                    {"rate", page_number(log.at("rate_hz"))},
                    {"duration", page_number(log.at("duration_s"))},
                    {"cutoff", cutoff},
                    {"role", data.at("logs").size() < 2 ? ""
                             : held.whole ? (judges ? "; it judges only" : "; it chooses and fits")
                                          : (judges ? "; the gap is in this one" : "")},
                    {"any_issue", !issues.empty()},
                    {"issues", issues}});
  }
  return logs;
}

json next_view(const json& next) {
  json separates = json::array();
  for (const json& pair : next.at("separates"))
    separates.push_back({{"one", with_spaces(pair.at(0))}, {"other", with_spaces(pair.at(1))}});
  return {{"text", next.at("text")}, {"any", !separates.empty()}, {"separates", separates}};
}

json head_view(const Diagnosis& d, const ReportContext& context, const std::vector<std::string>& files) {
  const auto [word, tone] = badge(d.verdict);
  const std::string sentence = verdict_sentence(d);
  return {{"robot", context.robot},
          {"files", list_in_words(files)},
          {"badge", word},
          {"tone", tone},
          {"sentence", sentence},
          {"long", sentence.size() > long_sentence},
          {"command", context.command},
          {"version", context.version},
          {"seconds", page_number(d.seconds, "%.1f")},
          {"view", context.referenced ? "the nominal model was fitted to the healthy log first (view B)"
                                      : "the nominal model is taken as given (view A)"}};
}

}  // namespace

std::string detail::file_name(const std::string& path) { return path.substr(path.find_last_of('/') + 1); }

json detail::report_view(const Diagnosis& diagnosis, const ReportContext& context,
                         std::vector<PlotGroup>& plots) {
  DiagnoseReport report;
  report.diagnosis = diagnosis;
  report.referenced = context.referenced;
  const json json_of = to_json(report);
  std::vector<std::string> files;
  for (const std::string& log : context.logs) files.push_back(file_name(log));
  const std::vector<std::size_t> worst = worst_joints(json_of);
  const JudgedLog held(diagnosis);

  json view = head_view(diagnosis, context, files);
  view["figures"] = figures_view(json_of, worst.empty() ? 0 : worst.front());
  view["answerable"] = answerable_view(json_of);
  view["answerable"]["assume"] = diagnosis.conventions.assume;
  view["answerable"]["equivalents"] = json::array();
  for (const std::string& other : diagnosis.conventions.equivalents)
    view["answerable"]["equivalents"].push_back({{"assume", other}});
  view["answerable"]["undecided"] = diagnosis.conventions.undecided_text;
  view["answerable"]["runner_up"] = diagnosis.conventions.runner_up;
  view["answerable"]["runner_up_explained"] = page_percent(diagnosis.conventions.runner_up_explained);
  add_effects_view(json_of, view);
  add_where_view(json_of, view);
  plots = {gap_plots(diagnosis, worst, held.log), replay_group(diagnosis.rollout)};
  view["residual"] = residual_view(diagnosis, json_of, held, plots[0], files);
  view["shrink"] = shrink_view(json_of);
  view["replay"] = replay_view(diagnosis, json_of, plots[1]);
  add_ranking_view(json_of, view);
  view["logs"] = logs_view(json_of, held, files);
  view["next"] = next_view(json_of.at("next_experiment"));
  return view;
}

std::string to_html(const Diagnosis& diagnosis, const ReportContext& context) {
  std::vector<PlotGroup> plots;
  json view = report_view(diagnosis, context, plots);
  add_plot_data(plots, view);
  return rendered_page("report", view);
}

}  // namespace dynid
