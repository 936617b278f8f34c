// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dynid/base/number.hpp"
#include "report_view.hpp"
#include "report_words.hpp"

namespace dynid::detail {
namespace {

using nlohmann::json;

constexpr double sure = 0.05;          // p-value of a framed cell
constexpr double least_shown = 0.005;  // part that reads as more than 0 %
constexpr double darkest = 0.85;       // opacity

/// The group that a regime is of; within one, the regimes share the gap out among them.
std::string group_of(const std::string& regime) {
  if (regime == "forward" || regime == "backward") return "Direction";
  if (regime.find("load") != std::string::npos) return "Load";
  if (regime.find("acceleration") != std::string::npos) return "Acceleration";
  if (regime.find("third") != std::string::npos) return "Time";
  return "Speed";
}

json cell_view(const json& cells, int joint, const std::string& regime, double largest) {
  const auto cell = std::find_if(cells.begin(), cells.end(), [&](const json& c) {
    return c.at("joint") == joint && c.at("regime") == regime;
  });
  if (cell == cells.end()) return {{"none", true}};
  const double share = cell->at("share"), p_value = cell->at("p_value");
  return {{"none", false},
          {"sure", p_value <= sure && share >= least_shown},
          {"shade", short_number(darkest * std::max(0.0, share) / largest, 5)},
          {"title", "joint " + std::to_string(joint) + ", " + regime + ": p = " + short_number(p_value, 5)},
          {"percent", page_number(std::round(100.0 * share), "%.0f")}};
}

}  // namespace

void add_where_view(const json& json_of, json& view) {
  const json &gap = json_of.at("gap"), &cells = gap.at("where");
  const int n = static_cast<int>(gap.at("rms").size());
  std::vector<std::string> regimes;
  double largest = 1e-12;
  for (const json& c : cells) {
    const std::string regime = c.at("regime");
    if (std::find(regimes.begin(), regimes.end(), regime) == regimes.end()) regimes.push_back(regime);
    largest = std::max(largest, c.at("share").get<double>());
  }
  view["joints"] = json::array();
  for (int j = 1; j <= n; ++j) view["joints"].push_back(j);
  view["columns"] = n + 1;
  view["groups"] = json::array();
  std::string group;
  for (const std::string& regime : regimes) {
    if (group_of(regime) != group) {
      group = group_of(regime);
      view["groups"].push_back({{"group", group}, {"regimes", json::array()}});
    }
    json row = {{"regime", regime}, {"cells", json::array()}};
    for (int j = 1; j <= n; ++j) row["cells"].push_back(cell_view(cells, j, regime, largest));
    view["groups"].back()["regimes"].push_back(std::move(row));
  }
  view["windows"] = json::array();
  for (const json& w : gap.at("windows")) {
    const std::string joints = joints_in_words(w.at("joints"), n);
    view["windows"].push_back({{"from", page_number(w.at("t0"), "%.2f")},
                               {"to", page_number(w.at("t1"), "%.2f")},
                               {"log", file_name(w.at("log"))},
                               {"joints", joints.empty() ? "all joints" : joints}});
  }
  view["any_window"] = !view["windows"].empty();
}

}  // namespace dynid::detail
