// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"
#include "app/words.hpp"

namespace dynid {
namespace {

/// A single number stands alone, as people write it.
nlohmann::json label(const Effect& effect) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const EffectParameter& p : simulation_effect(effect.name).parameters) {
    const std::vector<double>& values = effect.parameters.at(p.key);
    if (p.per_joint || values.size() > 1) {
      parameters[p.key] = values;
    } else {
      parameters[p.key] = values.front();
    }
  }
  return {{"name", effect.name}, {"joints", effect.joints}, {"parameters", parameters}};
}

}  // namespace

nlohmann::json labels_json(const SimulateReport& report) {
  nlohmann::json labels = nlohmann::json::array();
  for (const Effect& effect : report.run.truth.effects) labels.push_back(label(effect));
  return labels;
}

nlohmann::json to_json(const SimulateReport& report) {
  nlohmann::json rms = nlohmann::json::array();
  for (const Eigen::VectorXd& added : report.effect_rms) rms.push_back(to_json(added));
  return {{"samples", report.run.log.samples()},
          {"rate_hz", report.rate},
          {"duration", report.run.t[report.run.t.size() - 1]},
          {"seed", report.seed},
          {"noise", report.noise},
          {"spread", report.spread},
          {"effects", labels_json(report)},
          {"effect_torque_rms", rms},
          {"tracking_error_max", to_json(report.tracking_error)},
          {"seconds", report.seconds}};
}

nlohmann::json to_json(const std::vector<EffectSpec>& effects) {
  nlohmann::json result = nlohmann::json::array();
  for (const EffectSpec& spec : effects) {
    nlohmann::json parameters = nlohmann::json::array();
    for (const EffectParameter& p : spec.parameters)
      parameters.push_back({{"key", p.key},
                            {"unit", p.unit},
                            {"text", p.text},
                            {"per_joint", p.per_joint},
                            {"size", p.initial.size()},
                            {"default", p.initial},
                            {"drawn_from", p.low},
                            {"drawn_to", p.high}});
    result.push_back({{"name", spec.name},
                      {"text", spec.text},
                      {"scope", detail::word_for(spec.scope)},
                      {"parameters", parameters}});
  }
  return {{"effects", result}};
}

}  // namespace dynid
