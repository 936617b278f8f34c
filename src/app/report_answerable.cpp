// SPDX-License-Identifier: Apache-2.0
//
// The report's first panel: can this log answer?
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "report_view.hpp"
#include "report_words.hpp"

namespace dynid::detail {

using nlohmann::json;

json answerable_view(const json& json_of) {
  const json &data = json_of.at("data"), &a = data.at("answerable"), &units = json_of.at("gap").at("unit");
  json readings = json::array(), joints = json::array(), blind = json::array();
  for (const json& c : data.at("conventions"))
    readings.push_back({{"name", capitalised(with_spaces(c.at("name")))},
                        {"text", c.at("text")},
                        {"before", page_percent(c.at("explained_before"))},
                        {"after", page_percent(c.at("explained_after"))}});
  for (std::size_t j = 0; j < a.at("joints").size(); ++j) {
    const json& e = a.at("joints").at(j);
    const std::string torque = j < units.size() ? units.at(j).get<std::string>() : "N m",
                      length = torque == "N" ? "m" : "rad";
    const auto with = [](const json& value, const std::string& unit) {
      return short_number(value.get<double>(), 3) + "\u00a0" + unit;
    };
    joints.push_back({{"joint", j + 1},
                      {"travel", with(e.at("travel"), length)},
                      {"speed", with(e.at("speed"), length + "/s")},
                      {"moving", page_percent(e.at("moving"))},
                      {"reversals", e.at("reversals")},
                      {"load", with(e.at("load"), torque)},
                      {"swing", page_percent(e.at("swing"))}});
  }
  for (const json& b : a.at("not_seen"))
    blind.push_back({{"text", capitalised(b.at("text").get<std::string>())}});
  const std::vector<std::string> channels = a.at("channels");
  return {{"any_reading", !readings.empty()},
          {"misread", json_of.at("verdict") == "misread"},
          {"readings", readings},
          {"duration", page_number(a.at("duration_s"))},
          {"rate", page_number(a.at("rate_hz"))},
          {"band", page_number(a.at("band_hz"))},
          {"channels", channels.empty() ? "none" : list_in_words(channels)},
          {"any_joint", !joints.empty()},
          {"joints", joints},
          {"any_blind", !blind.empty()},
          {"blind", blind}};
}

}  // namespace dynid::detail
