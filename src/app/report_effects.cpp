// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>
#include <vector>

#include "dynid/base/text.hpp"
#include "report_view.hpp"
#include "report_words.hpp"

namespace dynid::detail {
namespace {

using nlohmann::json;

/// One number stands without a list.
double value_at(const json& x, std::size_t k) { return (x.is_array() ? x.at(k) : x).get<double>(); }
std::size_t size_of(const json& x) { return x.is_array() ? x.size() : 1; }

std::string heading(const std::string& key, const json& parameter) {
  const std::string unit = parameter.at("unit");
  std::string text = with_spaces(key) + (unit == "1" ? "" : " [" + unit + "]");
  if (const std::size_t square = text.find("^2"); square != std::string::npos)
    text.replace(square, 2, "\u00b2");
  return text;
}

/// `value` and `interval` of number k.
json estimate_view(const json& parameter, std::size_t k) {
  const double value = value_at(parameter.at("value"), k);
  const char* format = std::abs(value) < 1e5 ? "%.3g" : "%.2f";  // a stamp counts from 1970
  return {{"value", page_number(value, format)},
          {"interval", page_number(value_at(parameter.at("low"), k), format) + " \u2026 " +
                           page_number(value_at(parameter.at("high"), k), format)}};
}

/// What number k of a parameter with `size` numbers is.
std::string component(const std::string& key, std::size_t size, std::size_t k) {
  static const char* const axes[] = {"x", "y", "z"};
  static const char* const tensor[] = {"xx", "xy", "xz", "yy", "yz", "zz"};
  static const char* const standard[] = {"xx", "xy", "yy", "xz", "yz", "zz"};
  if (size == 1) return "";
  if (size == 3) return std::string(" ") + axes[k];
  if (size == 6) return std::string(" ") + (key == "inertia_about_origin" ? standard[k] : tensor[k]);
  return " " + std::to_string(k + 1);
}

json of_joints_view(const json& effect) {
  json keys = json::array(), rows = json::array();
  for (const auto& [key, p] : effect.at("parameters").items())
    if (p.at("per_joint")) keys.push_back(heading(key, p));
  if (keys.empty()) return false;
  for (const json& joint : effect.at("joints")) {
    json values = json::array();
    for (const json& p : effect.at("parameters"))
      if (p.at("per_joint")) values.push_back(estimate_view(p, joint.get<std::size_t>() - 1));
    rows.push_back({{"joint", joint}, {"values", values}});
  }
  return {{"keys", keys}, {"rows", rows}};
}

json others_view(const json& effect) {
  json rows = json::array();
  for (const auto& [key, p] : effect.at("parameters").items()) {
    if (p.at("per_joint")) continue;
    const std::size_t size = size_of(p.at("value"));
    for (std::size_t k = 0; k < size; ++k) {
      rows.push_back(estimate_view(p, k));
      rows.back()["key"] = heading(key, p) + component(key, size, k);
    }
  }
  if (rows.empty()) return false;
  return {{"rows", rows}};
}

json aliases_view(const json& names) {
  json list = json::array();
  for (std::size_t k = 0; k < names.size(); ++k)
    list.push_back({{"name", with_spaces(names.at(k))},
                    {"before", k == 0                  ? ""
                               : k + 1 == names.size() ? " and "
                                                       : ", "}});
  return list;
}

}  // namespace

void add_effects_view(const json& json_of, json& view) {
  const auto n = static_cast<Eigen::Index>(json_of.at("gap").at("rms").size());
  json effects = json::array();
  bool any_alias = false;
  for (const json& e : json_of.at("effects")) {
    const std::string where = joints_in_words(e.at("joints"), n);
    any_alias = any_alias || !e.at("aliases").empty();
    effects.push_back({{"name", capitalised(with_spaces(e.at("name")))},
                       {"where", where.empty() ? "whole arm" : where},
                       {"probability", page_probability(e.at("probability"))},
                       {"share", page_percent(e.at("share"))},
                       {"aliases", aliases_view(e.at("aliases"))},
                       {"any_alias", !e.at("aliases").empty()},
                       {"of_joints", of_joints_view(e)},
                       {"others", others_view(e)}});
  }
  view["alias_note"] =
      effects.empty() ? "Aliases: none, as no effect was adopted."
      : !any_alias    ? "Aliases: none. No other effect of the catalogue explains these logs as well."
                   : "Aliases are effects that make nearly the same torques on these motions: any of a class "
                     "may be the cause.";
  view["effects"] = std::move(effects);
  const double error = json_of.at("nominal_error");
  view["nominal_error"] = error > 0.0 ? json(page_number(100.0 * error)) : json(false);
}

}  // namespace dynid::detail
