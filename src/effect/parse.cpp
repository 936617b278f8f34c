// SPDX-License-Identifier: Apache-2.0
#include "dynid/effect/parse.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>
#include <vector>

#include "dynid/effect/complete.hpp"
#include "effect/parse_parameters.hpp"

namespace dynid {
namespace {

using detail::refuse_effect;

double number(const EffectSchema& schema, const std::string& key, std::string_view text) {
  double value = 0.0;
  const char *first = text.data(), *last = first + text.size();
  if (first != last && *first == '+') ++first;
  const auto [end, code] = std::from_chars(first, last, value);
  if (first == last || code != std::errc() || end != last || !std::isfinite(value))
    refuse_effect(schema.name, key + ": '" + std::string(text) + "' is not a number");
  return value;
}

std::vector<std::string_view> split(std::string_view text, char at) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t end = text.find(at);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

}  // namespace

Effect detail::parse_parameters(const EffectSchema& schema, const std::string& text, const Robot& robot) {
  const std::size_t colon = text.find(':');
  Effect effect;
  effect.name = schema.name;
  std::map<std::string, std::vector<double>> given;
  if (colon != std::string::npos) {
    for (const std::string_view item : split(std::string_view(text).substr(colon + 1), ',')) {
      const std::size_t equals = item.find('=');
      if (equals == std::string_view::npos || equals == 0)
        detail::refuse_effect(effect.name, "'" + std::string(item) + "' is not key=value");
      const std::string key(item.substr(0, equals));
      const std::string_view value = item.substr(equals + 1);
      if (key == "joints") {
        if (!effect.joints.empty()) detail::refuse_effect(effect.name, "joints: given twice");
        for (const std::string_view part : split(value, '+')) {
          const double joint = number(schema, key, part);
          if (joint != std::floor(joint))
            detail::refuse_effect(effect.name, "joints: '" + std::string(part) + "' is not a joint");
          effect.joints.push_back(static_cast<int>(std::clamp(joint, -1.0, 1e6)));
        }
        continue;
      }
      schema.parameter(key);
      std::vector<double> values;
      for (const std::string_view part : split(value, ':')) values.push_back(number(schema, key, part));
      if (!given.emplace(key, values).second) detail::refuse_effect(effect.name, key + ": given twice");
    }
  }
  const std::vector<int> as_given = effect.joints;
  effect.joints = detail::effect_joints(schema, effect.joints, robot);
  if (!as_given.empty() && as_given != effect.joints)
    detail::refuse_effect(effect.name,
                          "joints: give them base to tip");  // values for each would be read in another order
  for (const auto& [key, values] : given) {
    if (!schema.parameter(key).per_joint) {
      effect.parameters[key] = values;
      continue;
    }
    if (values.size() != 1 && values.size() != effect.joints.size())
      detail::refuse_effect(effect.name, key + ": expected one value or one for each of the " +
                                             std::to_string(effect.joints.size()) + " joints, found " +
                                             std::to_string(values.size()));
    std::vector<double>& all = effect.parameters[key];
    all.assign(static_cast<std::size_t>(robot.size()), 0.0);
    for (std::size_t k = 0; k < effect.joints.size(); ++k)
      all[static_cast<std::size_t>(effect.joints[k] - 1)] = values.size() == 1 ? values[0] : values[k];
  }
  if (as_given.empty() && schema.scope == EffectScope::link) effect.joints.clear();  // `link` may say which
  return effect;
}

Effect parse_effect(const std::string& text, const Robot& robot) {
  return complete_effect(detail::parse_parameters(effect_schema(text.substr(0, text.find(':'))), text, robot),
                         robot);
}

}  // namespace dynid
