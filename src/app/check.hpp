// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/identification/conventions.hpp"

namespace dynid::detail {

// Each throws OptionError naming the option, its value and the rule broken; what is not a number breaks all.
void check_positive(const std::string& option, double value);
void check_not_negative(const std::string& option, double value);
void check_within(const std::string& option, double value, double lowest, double highest);

/// parse_assumptions(), what is wrong with the text being the fault of the option `assume`.
Assumptions assumptions(const std::string& text, int joints);

}  // namespace dynid::detail
