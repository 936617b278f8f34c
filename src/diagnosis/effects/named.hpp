// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/effect/catalogue.hpp"

namespace dynid::detail {

/// A value of effect `effect` for joint `joint` (from 0), with what the catalogue says of it.
inline NamedValue named(const std::string& effect, const std::string& key, const Robot& robot, int joint,
                        const Eigen::VectorXd& value) {
  const EffectSchema& schema = effect_schema(effect);
  return {key, schema.unit(key, robot, joint), value, schema.parameter(key).per_joint};
}
inline NamedValue named(const std::string& effect, const std::string& key, const Robot& robot, int joint,
                        double value) {
  return named(effect, key, robot, joint, Eigen::VectorXd::Constant(1, value));
}

}  // namespace dynid::detail
