// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {
namespace {

nlohmann::json link_json(const LinkInertia& link) {
  nlohmann::json inertia = nlohmann::json::array();
  for (int i = 0; i < 3; ++i) inertia.push_back({link.inertia(i, 0), link.inertia(i, 1), link.inertia(i, 2)});
  return {{"mass", link.mass}, {"com", to_json(link.com)}, {"inertia", inertia}};
}

}  // namespace

nlohmann::json to_json(const RetrieveReport& report) {
  const RetrievalResult& result = report.result;
  nlohmann::json constraints = nlohmann::json::array(), runs = nlohmann::json::array(),
                 links = nlohmann::json::array(), trade_off = nlohmann::json::array();
  for (const ConstraintMargin& c : result.constraints)
    constraints.push_back({{"name", c.name}, {"margin", c.margin}, {"active", c.active}});
  for (const RetrievalRun& run : result.runs)
    runs.push_back({{"seed", run.seed},
                    {"objective", run.objective},
                    {"penalty", run.penalty},
                    {"seconds", run.seconds}});
  for (const LinkInertia& link : result.links) links.push_back(link_json(link));
  for (const PriorTradeOff& t : result.trade_off)
    trade_off.push_back({{"weight", t.weight}, {"objective", t.objective}, {"distance", t.distance}});
  return {{"objective", result.objective},
          {"penalty", result.penalty},
          {"feasible", result.feasible},
          {"interrupted", result.interrupted},
          {"total_mass", result.total_mass},
          {"constraints", constraints},
          {"runs", runs},
          {"seconds", result.seconds},
          {"links", links},
          {"spread", to_json(result.spread)},
          {"trade_off", trade_off}};
}

}  // namespace dynid
