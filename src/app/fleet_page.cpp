// SPDX-License-Identifier: Apache-2.0
//
// The page of a fleet: figures put into words for src/app/page/fleet.html.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/page.hpp"
#include "dynid/app/fleet.hpp"
#include "dynid/base/text.hpp"
#include "report_words.hpp"

namespace dynid {
namespace {

using nlohmann::json;
using namespace detail;

std::string cause_in_words(const FleetCause& cause) {
  return capitalised(cause.effects.empty() ? with_spaces(cause.verdict)
                                           : with_spaces(join(cause.effects, ", ")));
}

json robots_view(const FleetReport& report) {
  double most = 1.0;
  for (const FleetEntry& e : report.entries) most = std::max(most, e.gap);
  json rows = json::array();
  for (const FleetEntry& e : report.entries) {
    json row = {{"robot", e.member.robot},
                {"logs", join(e.member.logs, ", ")},
                {"failed", !e.error.empty()},
                {"error", e.error}};
    if (e.error.empty()) {
      json effects = json::array();
      for (const ComparedEffect& effect : e.diagnosis.effects)
        effects.push_back({{"name", with_spaces(effect.name)},
                           {"where", joints_in_words(effect.joints, e.diagnosis.rms.size())},
                           {"probability", page_probability(effect.probability)},
                           {"share", page_percent(effect.share)}});
      row.update(
          {{"gap", page_number(e.gap)},
           {"width", page_number(most > 1.0 ? 100.0 * std::log1p(e.gap) / std::log1p(most) : 0.0, "%.0f")},
           {"verdict", capitalised(with_spaces(e.diagnosis.verdict))},
           {"tone", verdict_tone(e.diagnosis.verdict)},
           {"shrink", e.diagnosis.shrink ? page_percent(std::max(0.0, *e.diagnosis.shrink)) : "\u2013"},
           {"effects", effects}});
    }
    rows.push_back(row);
  }
  return rows;
}

json causes_view(const FleetReport& report) {
  json rows = json::array();
  for (const FleetCause& cause : report.causes) {
    std::vector<std::string> robots;
    for (const std::size_t k : cause.entries) robots.push_back(report.entries[k].member.robot);
    rows.push_back({{"cause", cause_in_words(cause)},
                    {"count", std::to_string(cause.entries.size())},
                    {"robots", join(robots, ", ")}});
  }
  return rows;
}

/// What most of them have, and which is worst.
std::string sentence(const FleetReport& report) {
  const auto failed = static_cast<std::size_t>(std::count_if(
      report.entries.begin(), report.entries.end(), [](const FleetEntry& e) { return !e.error.empty(); }));
  const std::size_t done = report.entries.size() - failed;
  std::string text;
  if (done > 0) {
    const FleetEntry& worst = report.entries.front();
    text = "The largest gap is that of " + worst.member.robot + ", " + page_number(worst.gap) +
           " times what is of no account. ";
    const FleetCause& common = report.causes.front();
    text += cause_in_words(common) + ": " + std::to_string(common.entries.size()) + " of " +
            std::to_string(done) + " robots.";
  }
  if (failed > 0)
    text += (text.empty() ? "" : " ") + std::to_string(failed) +
            (failed == 1 ? " robot could not be diagnosed." : " robots could not be diagnosed.");
  return text;
}

}  // namespace

std::string FleetReport::html(const std::string& command, const std::string& version) const {
  return rendered_page("fleet", {{"sentence", sentence(*this)},
                                 {"count", std::to_string(entries.size())},
                                 {"robots", robots_view(*this)},
                                 {"any_cause", !causes.empty()},
                                 {"causes", causes_view(*this)},
                                 {"command", command},
                                 {"version", version}});
}

}  // namespace dynid
