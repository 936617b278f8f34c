// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/coefficient.hpp"

namespace dynid {

/// What to do with a model that breaks eq. (11) or (16).
enum class Consistency {
  refuse,  ///< throw Error naming link, rule and margin
  warn,    ///< list what is broken for the caller
  ignore,
};

/// Reads a URDF or MJCF (its first character is `<`; see parse_urdf(), read_mjcf()) or a model file (see
/// read_model()). These are models too: inertials, friction, servos, with no coefficients.
///
/// `base`, `tip`: links of a URDF or MJCF; a model file is one chain, and they must be its own or empty.
/// `broken`, if given, takes the broken rules (empty under Consistency::ignore). Throws Error.
ModelFile read_model_file(const std::string& path, const std::string& base = "", const std::string& tip = "",
                          Consistency consistency = Consistency::refuse,
                          std::vector<Inconsistency>* broken = nullptr);

/// The robot of read_model_file().
Robot read_robot(const std::string& path, const std::string& base = "", const std::string& tip = "",
                 Consistency consistency = Consistency::refuse, std::vector<Inconsistency>* broken = nullptr);

}  // namespace dynid
