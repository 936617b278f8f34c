// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {

nlohmann::json to_json(const FleetReport& report) {
  using nlohmann::json;
  json robots = json::array(), causes = json::array();
  for (const FleetEntry& e : report.entries)
    robots.push_back({{"robot", e.member.robot},
                      {"logs", e.member.logs},
                      {"error", e.error.empty() ? json() : json(e.error)},
                      {"gap", e.error.empty() ? json(e.gap) : json()},
                      {"diagnosis", e.error.empty() ? json::parse(e.json) : json()}});
  for (const FleetCause& cause : report.causes) {
    json of = json::array();
    for (const std::size_t k : cause.entries) of.push_back(report.entries[k].member.robot);
    causes.push_back({{"effects", cause.effects},
                      {"verdict", cause.verdict.empty() ? json() : json(cause.verdict)},
                      {"robots", of}});
  }
  return {{"format", "dynid-fleet-1"}, {"robots", robots}, {"causes", causes}};
}

}  // namespace dynid
