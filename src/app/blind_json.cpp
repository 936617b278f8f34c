// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {
namespace {

nlohmann::json found_json(const FoundEffect& e) {
  nlohmann::json intervals = nlohmann::json::object();
  for (const ParameterEstimate& p : e.parameters)
    intervals[p.key] = {{"low", std::vector<double>(p.low.begin(), p.low.end())},
                        {"high", std::vector<double>(p.high.begin(), p.high.end())}};
  return {{"name", e.effect.name},  {"joints", e.effect.joints},    {"parameters", e.effect.parameters},
          {"intervals", intervals}, {"probability", e.probability}, {"aliases", e.aliases}};
}

nlohmann::json considered_json(const ConsideredEffect& e) {
  nlohmann::json grounds;
  for (std::size_t k = 0; k < ground_count; ++k) grounds[ground_names[k]] = e.grounds.value[k];
  return {{"name", e.name},
          {"joints", e.joints},
          {"share", e.share},
          {"probability", e.probability},
          {"grounds", grounds}};
}

nlohmann::json case_json(const BlindCase& c) {
  nlohmann::json truth = nlohmann::json::array(), found = nlohmann::json::array();
  for (const Effect& e : c.truth)
    truth.push_back({{"name", e.name}, {"joints", e.joints}, {"parameters", e.parameters}});
  for (const FoundEffect& e : c.found) found.push_back(found_json(e));
  nlohmann::json considered = nlohmann::json::array();
  for (const ConsideredEffect& e : c.considered) considered.push_back(considered_json(e));
  return {{"truth", truth},           {"withheld", c.withheld},       {"verdict", to_string(c.verdict)},
          {"found", found},           {"p_value", c.p_value},         {"explained", c.explained},
          {"shrink", c.shrink},       {"true_shrink", c.true_shrink}, {"nominal_error", c.nominal_error},
          {"seconds", c.seconds},     {"failure", c.failure},         {"drawn", c.drawn},
          {"shares", c.truth_shares}, {"considered", considered},     {"background", c.background}};
}

}  // namespace

nlohmann::json to_json(const BlindReport& report) {
  const BlindScore& s = report.score;
  nlohmann::json result = {{"cases", s.cases},
                           {"failures", s.failures},
                           {"seed", report.options.seed},
                           {"no_gap", s.no_gap},
                           {"false_alarms", s.false_alarms},
                           {"known", s.known},
                           {"first_right", s.first_right},
                           {"class_right", s.class_right},
                           {"joints_right", s.joints_right},
                           {"unknown", s.unknown},
                           {"abstained", s.abstained},
                           {"pairs", s.pairs},
                           {"both_found", s.both_found},
                           {"confident_wrong", s.confident_wrong},
                           {"calibration_error", s.calibration_error},
                           {"intervals", s.intervals},
                           {"covered", s.covered},
                           {"parameter_error", s.parameter_error},
                           {"shrink", s.shrink},
                           {"shrink_of_true", s.shrink_of_true},
                           {"confusion", s.confusion}};
  for (const auto& [key, value] : further_figures(s)) result[key] = value;
  result["list"] = nlohmann::json::array();
  for (const BlindCase& c : report.cases) result["list"].push_back(case_json(c));
  return result;
}

}  // namespace dynid
