// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "app/serialise.hpp"

namespace dynid {
namespace {

/// An end of an interval; null where there is none.
nlohmann::json bound(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

nlohmann::json servo_json(const ServoFit& fit) {
  nlohmann::json parameters = nlohmann::json::object(), aliases = nlohmann::json::array(),
                 terms = nlohmann::json::array();
  for (const ServoValue& v : fit.values)
    parameters[v.name] = {
        {"value", v.value}, {"low", bound(v.low)}, {"high", bound(v.high)}, {"unit", v.unit}};
  for (const ServoAlias& a : fit.aliases)
    aliases.push_back({{"names", {a.first, a.second}}, {"correlation", a.correlation}});
  for (const ServoTerm& t : fit.terms)
    terms.push_back({{"name", t.name}, {"without", t.without}, {"with", t.with}, {"kept", t.kept}});
  return {{"joint", fit.joint},    {"name", fit.name},         {"identified", fit.identified},
          {"si", fit.si},          {"parameters", parameters}, {"aliases", aliases},
          {"terms", terms},        {"error", fit.error},       {"held_out", fit.held_out},
          {"remarks", fit.remarks}};
}

}  // namespace

nlohmann::json to_json(const IdentifyServosReport& report) {
  nlohmann::json joints = nlohmann::json::array(), issues = nlohmann::json::array();
  for (const ServoFit& fit : report.identification.joints) joints.push_back(servo_json(fit));
  for (const DataIssue& i : report.identification.issues)
    issues.push_back(
        {{"name", i.name}, {"joints", i.joints}, {"value", i.value}, {"unit", i.unit}, {"text", i.text}});
  return {{"joints", joints},
          {"error", to_json(report.error)},
          {"held_out", to_json(report.held_out)},
          {"confidence", report.confidence},
          {"data", {{"issues", issues}}},
          {"seconds", report.seconds}};
}

nlohmann::json to_json(const ReplayReport& report) {
  return {{"samples", report.replay.t.size()},
          {"error", to_json(report.replay.error)},
          {"mean_error", report.replay.error.mean()},
          {"perfect_tracking_error", to_json(report.tracking)}};
}

}  // namespace dynid
