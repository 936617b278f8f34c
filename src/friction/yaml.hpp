// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/yaml.hpp"
#include "dynid/base/number.hpp"
#include "dynid/friction/joint_friction.hpp"

namespace dynid::detail {

// Friction in a model file, as the descriptors of the laws have it. `Friction`: JointFriction, or any struct
// that has laws() as it has.

/// Every key, law by law.
template <class Friction>
std::vector<std::string> friction_keys() {
  std::vector<std::string> keys;
  const Friction friction;
  for_each_parameter(friction, [&keys](const auto&, const auto& p) { keys.push_back(p.key); });
  return keys;
}

template <class Law>
void read_law(const YamlItem& item, Law& law) {
  bool any = false;
  for (const auto& p : Law::parameters()) any = any || item.has(p.key);
  for (const auto& p : Law::parameters()) {
    const bool needed = any && Law::all_or_none && p.role != FrictionRole::given;
    if (!needed && !item.has(p.key)) continue;
    law.*p.value = item.at(p.key).number();
    if (p.role == FrictionRole::given && law.*p.value < 0.0)
      item.at(p.key).fail("expected a number that is not negative");
  }
}

template <class Friction>
Friction read_friction(const YamlItem& item) {
  item.expect_keys(friction_keys<Friction>());
  Friction friction;
  std::apply([&item](auto&... law) { (read_law(item, law), ...); }, friction.laws());
  return friction;
}

/// The entries of a law in a map that has been begun: none where all but what was given is zero.
template <class Law>
void put_law(YAML::Emitter& out, const Law& law) {
  bool any = false;
  for (const auto& p : Law::parameters()) any = any || (p.role != FrictionRole::given && law.*p.value != 0.0);
  if (!any) return;
  for (const auto& p : Law::parameters())
    if (p.role != FrictionRole::given || law.*p.value != 0.0)
      out << YAML::Key << p.key << YAML::Value << exact_number(law.*p.value);
}

/// `friction: {...}`; nothing where every law is zero.
template <class Friction>
void put_friction(YAML::Emitter& out, const Friction& friction) {
  bool any = false;
  for_each_parameter(friction, [&any](const auto& law, const auto& p) {
    any = any || (p.role != FrictionRole::given && law.*p.value != 0.0);
  });
  if (!any) return;
  out << YAML::Key << "friction" << YAML::Value << YAML::Flow << YAML::BeginMap;
  std::apply([&out](const auto&... law) { (put_law(out, law), ...); }, friction.laws());
  out << YAML::EndMap;
}

}  // namespace dynid::detail
