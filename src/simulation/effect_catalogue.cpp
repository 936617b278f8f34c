// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/effect_catalogue.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <string_view>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "effects/effect_model.hpp"

namespace dynid {
namespace detail {

const std::vector<EffectDefinition>& effect_definitions() {
  static const std::vector<EffectDefinition> definitions = [] {
    std::vector<EffectDefinition> found;
    for (auto family :
         {rigid_body_effects, friction_effects, presliding_effects, thermal_effects, position_effects,
          sensor_effects, transmission_effects, coupling_effects, contact_effects}) {
      for (EffectDefinition& definition : family()) found.push_back(std::move(definition));
    }
    return found;
  }();
  return definitions;
}

const EffectDefinition& effect_definition(const std::string& name) {
  std::string known;
  for (const EffectDefinition& definition : effect_definitions()) {
    if (definition.spec.name == name) return definition;
    known += (known.empty() ? "" : ", ") + definition.spec.name;
  }
  throw Error("effect '" + name + "': unknown; known: " + known);
}

Eigen::VectorXd gravity_peaks(const Robot& robot, std::mt19937_64& random) {
  const Model<> model(robot);
  Workspace<> ws(model);
  const int n = robot.size();
  Eigen::VectorXd q(n), g(n), peak = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < 200; ++k) {
    for (int j = 0; j < n; ++j) {
      const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
      q[j] = uniform(random, std::max(limits.lower, -M_PI), std::min(limits.upper, M_PI));
    }
    gravity(model, ws, q, g);
    peak = peak.cwiseMax(g.cwiseAbs());
  }
  return peak;
}

}  // namespace detail

namespace {

std::string short_number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error("effect '" + name + "': " + what);
}

const EffectParameter* find(const EffectSpec& spec, const std::string& key) {
  for (const EffectParameter& p : spec.parameters)
    if (p.key == key) return &p;
  return nullptr;
}

const EffectParameter& parameter(const EffectSpec& spec, const std::string& key) {
  if (const EffectParameter* p = find(spec, key)) return *p;
  std::string known;
  for (const EffectParameter& p : spec.parameters) known += (known.empty() ? "" : ", ") + p.key;
  refuse(spec.name, "no parameter is called '" + key + "'; its own: joints, " + known);
}

/// The joints meant, checked: increasing, each once, of the robot, as many as the scope asks for.
std::vector<int> joints_of(const EffectSpec& spec, std::vector<int> joints, const Robot& robot) {
  const int n = robot.size();
  std::sort(joints.begin(), joints.end());
  for (std::size_t k = 0; k < joints.size(); ++k) {
    if (joints[k] < 1 || joints[k] > n)
      refuse(spec.name, "joints: the robot has no joint " + std::to_string(joints[k]) + " (it has 1 to " +
                            std::to_string(n) + ")");
    if (k > 0 && joints[k] == joints[k - 1])
      refuse(spec.name, "joints: " + std::to_string(joints[k]) + " stands there twice");
  }
  std::vector<int> all(static_cast<std::size_t>(n));
  std::iota(all.begin(), all.end(), 1);
  if (spec.scope == EffectScope::one_link) {
    if (joints.empty()) joints = {n};
    if (joints.size() != 1) refuse(spec.name, "joints: one joint is meant, the one that carries the link");
  } else if (spec.scope == EffectScope::pair) {
    if (joints.empty() && n >= 2) joints = {n - 1, n};
    if (joints.size() != 2) refuse(spec.name, "joints: two joints are meant");
  } else if (joints.empty()) {
    joints = all;
  }
  return joints;
}

double number(const EffectSpec& spec, const std::string& key, std::string_view text) {
  double value = 0.0;
  const char *first = text.data(), *last = first + text.size();
  if (first != last && *first == '+') ++first;
  const auto [end, code] = std::from_chars(first, last, value);
  if (first == last || code != std::errc() || end != last || !std::isfinite(value))
    refuse(spec.name, key + ": '" + std::string(text) + "' is not a number");
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

const std::vector<EffectSpec>& simulation_effects() {
  static const std::vector<EffectSpec> specs = [] {
    std::vector<EffectSpec> found;
    for (const detail::EffectDefinition& definition : detail::effect_definitions())
      found.push_back(definition.spec);
    return found;
  }();
  return specs;
}

const EffectSpec& simulation_effect(const std::string& name) { return detail::effect_definition(name).spec; }

Effect complete_effect(const Effect& effect, const Robot& robot) {
  const EffectSpec& spec = simulation_effect(effect.name);
  const auto n = static_cast<std::size_t>(robot.size());
  Effect full = {effect.name, joints_of(spec, effect.joints, robot), {}};
  for (const auto& [key, values] : effect.parameters) parameter(spec, key);
  for (const EffectParameter& p : spec.parameters) {
    const auto given = effect.parameters.find(p.key);
    std::vector<double>& values = full.parameters[p.key];
    const std::size_t size = p.per_joint ? n : p.initial.size();
    if (given != effect.parameters.end()) {
      values = given->second;
      if (values.size() != size)
        refuse(spec.name, p.key + ": expected " + std::to_string(size) + " value" + (size == 1 ? "" : "s") +
                              ", found " + std::to_string(values.size()));
    } else if (p.per_joint) {
      values.assign(n, 0.0);
      for (const int joint : full.joints) values[static_cast<std::size_t>(joint - 1)] = p.initial.front();
    } else {
      values = p.initial;
    }
    for (std::size_t k = 0; k < values.size(); ++k) {
      const bool used =
          !p.per_joint || std::binary_search(full.joints.begin(), full.joints.end(), static_cast<int>(k) + 1);
      if (!std::isfinite(values[k]) || (used && !(values[k] >= p.least && values[k] <= p.most)))
        refuse(spec.name, p.key + ": " + short_number(values[k]) + " is not between " +
                              short_number(p.least) + " and " + short_number(p.most) +
                              (p.unit == "1" ? "" : " " + p.unit));
      if (!used) values[k] = 0.0;
    }
  }
  if (const auto link = full.parameters.find("link"); link != full.parameters.end()) {
    double& value = link->second.front();
    if (value == 0.0) value = double(n);
    if (value != std::floor(value) || value > double(n))
      refuse(spec.name,
             "link: " + short_number(value) + " is not a link of the robot (1 to " + std::to_string(n) + ")");
    full.joints.resize(static_cast<std::size_t>(value));  // those beyond it do not feel it
    std::iota(full.joints.begin(), full.joints.end(), 1);
  }
  return full;
}

Effect parse_effect(const std::string& text, const Robot& robot) {
  const std::size_t colon = text.find(':');
  Effect effect;
  effect.name = text.substr(0, colon);
  const EffectSpec& spec = simulation_effect(effect.name);
  std::map<std::string, std::vector<double>> given;
  if (colon != std::string::npos) {
    for (const std::string_view item : split(std::string_view(text).substr(colon + 1), ',')) {
      const std::size_t equals = item.find('=');
      if (equals == std::string_view::npos || equals == 0)
        refuse(effect.name, "'" + std::string(item) + "' is not key=value");
      const std::string key(item.substr(0, equals));
      const std::string_view value = item.substr(equals + 1);
      if (key == "joints") {
        if (!effect.joints.empty()) refuse(effect.name, "joints: given twice");
        for (const std::string_view part : split(value, '+')) {
          const double joint = number(spec, key, part);
          if (joint != std::floor(joint))
            refuse(effect.name, "joints: '" + std::string(part) + "' is not a joint");
          effect.joints.push_back(static_cast<int>(std::clamp(joint, -1.0, 1e6)));
        }
        continue;
      }
      parameter(spec, key);
      std::vector<double> values;
      for (const std::string_view part : split(value, ':')) values.push_back(number(spec, key, part));
      if (!given.emplace(key, values).second) refuse(effect.name, key + ": given twice");
    }
  }
  const std::vector<int> as_given = effect.joints;
  effect.joints = joints_of(spec, effect.joints, robot);
  if (!as_given.empty() && as_given != effect.joints)
    refuse(effect.name, "joints: give them base to tip");  // values for each would be read in another order
  for (const auto& [key, values] : given) {
    if (!parameter(spec, key).per_joint) {
      effect.parameters[key] = values;
      continue;
    }
    if (values.size() != 1 && values.size() != effect.joints.size())
      refuse(effect.name, key + ": expected one value or one for each of the " +
                              std::to_string(effect.joints.size()) + " joints, found " +
                              std::to_string(values.size()));
    std::vector<double>& all = effect.parameters[key];
    all.assign(static_cast<std::size_t>(robot.size()), 0.0);
    for (std::size_t k = 0; k < effect.joints.size(); ++k)
      all[static_cast<std::size_t>(effect.joints[k] - 1)] = values.size() == 1 ? values[0] : values[k];
  }
  return complete_effect(effect, robot);
}

Effect draw_effect(const std::string& name, const Robot& robot, unsigned long seed, double strength,
                   double duration) {
  const detail::EffectDefinition& definition = detail::effect_definition(name);
  const EffectSpec& spec = definition.spec;
  const int n = robot.size();
  if (spec.scope == EffectScope::pair && n < 2) refuse(name, "the robot has one joint, it takes two");
  if (!(strength > 0.0) || !std::isfinite(strength)) refuse(name, "strength must be positive");
  std::vector<unsigned long> seeds = {seed};  // the name too: effects of one seed have nothing in common
  for (const char c : name) seeds.push_back(static_cast<unsigned char>(c));
  std::seed_seq sequence(seeds.begin(), seeds.end());
  std::mt19937_64 random(sequence);
  Effect effect;
  effect.name = name;
  if (spec.scope == EffectScope::one_link) {
    effect.joints = {std::uniform_int_distribution<int>(std::max(1, n - 4), n)(random)};
  } else if (spec.scope == EffectScope::joints) {
    std::vector<int> able;
    const Eigen::VectorXd peak = detail::gravity_peaks(robot, random);
    for (int j = 1; j <= n; ++j)
      if (peak[j - 1] >= definition.least_load * peak.maxCoeff()) able.push_back(j);
    std::shuffle(able.begin(), able.end(), random);
    const auto most = std::min<std::size_t>(3, able.size());
    able.resize(std::uniform_int_distribution<std::size_t>(1, most)(random));
    effect.joints = able;
    std::sort(effect.joints.begin(), effect.joints.end());
  }
  for (const EffectParameter& p : spec.parameters) {
    const auto draw = [&](std::size_t k) {
      double x = detail::uniform(random, p.low[k], p.high[k]);
      if (p.either_sign && random() % 2 == 0) x = -x;
      if (p.scale == EffectParameter::Scale::times) x *= strength;
      if (p.scale == EffectParameter::Scale::divided) x /= strength;
      return std::clamp(x, p.least, p.most);
    };
    std::vector<double>& values = effect.parameters[p.key];
    if (p.per_joint) {
      values.assign(static_cast<std::size_t>(n), 0.0);
      for (const int joint : effect.joints) values[static_cast<std::size_t>(joint - 1)] = draw(0);
    } else {
      for (std::size_t k = 0; k < p.initial.size(); ++k) values.push_back(draw(k));
    }
  }
  if (definition.draw != nullptr) definition.draw(effect, robot, random, strength, duration);
  return complete_effect(effect, robot);
}

}  // namespace dynid
