// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {
namespace {

using nlohmann::json;

const char* word_for(Change::Kind kind) {
  switch (kind) {
    case Change::Kind::verdict:
      return "verdict";
    case Change::Kind::gap:
      return "gap";
    case Change::Kind::appeared:
      return "appeared";
    case Change::Kind::gone:
      return "gone";
    case Change::Kind::changed:
      break;
  }
  return "changed";
}

json effect_json(const ComparedEffect& effect) {
  json parameters = json::object();
  for (const ComparedParameter& p : effect.parameters)
    parameters[p.key] = {
        {"unit", p.unit}, {"value", to_json(p.value)}, {"low", to_json(p.low)}, {"high", to_json(p.high)}};
  return {{"joints", effect.joints},
          {"probability", effect.probability},
          {"share", effect.share},
          {"parameters", parameters}};
}

}  // namespace

json to_json(const CompareReport& report) {
  json diagnoses = json::array(), effects = json::array(), changes = json::array();
  for (const ComparedDiagnosis& d : report.diagnoses)
    diagnoses.push_back({{"name", d.name},
                         {"verdict", d.verdict},
                         {"rms", to_json(d.rms)},
                         {"floor", to_json(d.floor)},
                         {"unit", d.unit},
                         {"shrink", d.shrink ? json(*d.shrink) : json()}});
  for (const EffectRow& row : report.effects) {
    json in = json::array();
    for (const auto& effect : row.in) in.push_back(effect ? effect_json(*effect) : json());
    effects.push_back({{"name", row.name}, {"in", in}});
  }
  for (const Change& change : report.changes)
    changes.push_back({{"kind", word_for(change.kind)}, {"to", change.to}, {"text", change.text}});
  return {
      {"format", "dynid-comparison-1"}, {"diagnoses", diagnoses}, {"effects", effects}, {"changes", changes}};
}

}  // namespace dynid
