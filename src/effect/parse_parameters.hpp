// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/effect/schema.hpp"

namespace dynid::detail {

/// What stands in `NAME[:key=value,...]`, by that schema, its joints checked and nothing completed. Throws
/// Error as parse_effect().
Effect parse_parameters(const EffectSchema& schema, const std::string& text, const Robot& robot);

}  // namespace dynid::detail
