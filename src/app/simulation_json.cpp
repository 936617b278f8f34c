// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/simulation/effect_catalogue.hpp"

namespace dynid {
namespace {

/// A single number stands alone, as people write it.
nlohmann::json label(const Effect& effect) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const EffectParameter& p : effect_schema(effect.name).parameters) {
    if (effect.parameters.count(p.key) == 0) continue;  // of another form
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

nlohmann::json to_json(const std::vector<EffectSchema>& effects) {
  nlohmann::json result = nlohmann::json::array();
  for (const EffectSchema& schema : effects) {
    nlohmann::json parameters = nlohmann::json::array();
    for (const EffectParameter& p : schema.parameters) {
      parameters.push_back({{"key", p.key},
                            {"unit", p.unit},
                            {"text", p.text},
                            {"per_joint", p.per_joint},
                            {"size", p.initial.size()},
                            {"default", p.initial},
                            {"required", p.required()},
                            {"form", p.form}});
      if (find_effect_schema(schema.name) == nullptr) continue;  // of servos: drawn by their bank
      for (const EffectDraw& draw : effect_draws(schema.name))
        if (draw.key == p.key) {
          parameters.back()["drawn_from"] = draw.low;
          parameters.back()["drawn_to"] = draw.high;
        }
    }
    result.push_back({{"name", schema.name},
                      {"text", schema.text},
                      {"scope", to_string(schema.scope)},
                      {"parameters", parameters}});
  }
  return {{"effects", result}};
}

}  // namespace dynid
