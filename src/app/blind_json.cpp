// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"
#include "dynid/base/error.hpp"
#include "dynid/effect/catalogue.hpp"

namespace dynid {
namespace {

Effect bank_effect(const nlohmann::json& e) {
  Effect out;
  out.name = e.at("name");
  out.joints = e.at("joints").get<std::vector<int>>();
  out.parameters = e.at("parameters").get<std::map<std::string, std::vector<double>>>();
  return out;
}

Eigen::VectorXd bank_vector(const nlohmann::json& x) {
  const auto values = x.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

FoundEffect found_of(const nlohmann::json& e) {
  FoundEffect out;
  out.effect = bank_effect(e);
  out.probability = e.at("probability");
  out.aliases = e.at("aliases").get<std::vector<std::string>>();
  const EffectSchema& schema = effect_schema(out.effect.name);
  for (const auto& [key, interval] : e.at("intervals").items()) {
    ParameterEstimate p;
    p.key = key;
    p.value = bank_vector(e.at("parameters").at(key));
    p.low = bank_vector(interval.at("low"));
    p.high = bank_vector(interval.at("high"));
    p.per_joint = schema.parameter(key).per_joint;
    if (p.low.size() != p.value.size() || p.high.size() != p.value.size())
      throw Error("an interval of " + out.effect.name + "." + key + " is not as long as its value");
    out.parameters.push_back(std::move(p));
  }
  return out;
}

ConsideredEffect considered_of(const nlohmann::json& e) {
  ConsideredEffect out;
  out.name = e.at("name");
  out.joints = e.at("joints").get<std::vector<int>>();
  out.share = e.at("share");
  out.probability = e.at("probability");
  for (std::size_t k = 0; k < ground_count; ++k) out.grounds.value[k] = e.at("grounds").at(ground_names[k]);
  return out;
}

BlindCase case_of(const nlohmann::json& c) {
  BlindCase out;
  for (const nlohmann::json& e : c.at("truth")) out.truth.push_back(bank_effect(e));
  for (const nlohmann::json& e : c.at("found")) out.found.push_back(found_of(e));
  for (const nlohmann::json& e : c.at("considered")) out.considered.push_back(considered_of(e));
  out.background = c.at("background").get<std::vector<std::string>>();
  out.withheld = c.at("withheld").get<std::vector<std::string>>();
  out.drawn = c.at("drawn").get<std::map<std::string, std::string>>();
  out.nominal_error = c.at("nominal_error");
  out.failure = c.at("failure");
  return out;
}

nlohmann::json found_json(const FoundEffect& e) {
  nlohmann::json intervals = nlohmann::json::object();
  for (const ParameterEstimate& p : e.parameters)
    intervals[p.key] = {{"low", std::vector<double>(p.low.begin(), p.low.end())},
                        {"high", std::vector<double>(p.high.begin(), p.high.end())}};
  return {{"name", e.effect.name},  {"joints", e.effect.joints},    {"parameters", e.effect.parameters},
          {"intervals", intervals}, {"probability", e.probability}, {"share", e.share},
          {"aliases", e.aliases}};
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
  return {{"truth", truth},
          {"withheld", c.withheld},
          {"verdict", to_string(c.verdict)},
          {"found", found},
          {"p_value", c.p_value},
          {"explained", c.explained},
          {"shrink", c.shrink},
          {"true_shrink", c.true_shrink},
          {"attainable", c.attainable},
          {"nominal_error", c.nominal_error},
          {"seconds", c.seconds},
          {"failure", c.failure},
          {"drawn", c.drawn},
          {"shares", c.truth_shares},
          {"considered", considered},
          {"background", c.background},
          {"within_tolerance", c.within_tolerance}};
}

}  // namespace

std::vector<BlindCase> blind_cases(const std::string& text, const std::string& source) {
  std::vector<BlindCase> out;
  try {
    const nlohmann::json bank = nlohmann::json::parse(text);
    for (const nlohmann::json& c : bank.at("list")) out.push_back(case_of(c));
  } catch (const nlohmann::json::exception& e) {
    throw Error(source + ": not the --json of `dynid blind` on torque logs: " + e.what());
  } catch (const Error& e) {
    throw Error(source + ": case " + std::to_string(out.size()) + ": " + e.what());
  }
  return out;
}

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
