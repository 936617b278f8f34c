// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/identification/conventions.hpp"

namespace dynid::detail {

// Each throws OptionError naming the option, its value and the rule broken; what is not a number breaks all.
void check_positive(const std::string& option, double value);
void check_not_negative(const std::string& option, double value);
void check_within(const std::string& option, double value, double lowest, double highest);

/// parse_assumptions(), what is wrong with the text being the fault of the option `assume`.
Assumptions assumptions(const std::string& text, int joints);

/// What `assume` (as IdentifyJob::assume) makes of logs and robot.
struct AssumedReading {
  ConventionReport conventions;  ///< found; not asked for where `assume` says how to read the logs
  bool applied = false;
};
/// Reads `logs` (and `others`, which do not speak in it) and mounts `robot` as assumed. Throws OptionError.
AssumedReading read_as_assumed(const std::string& assume, Robot& robot, std::vector<Log>& logs,
                               std::vector<Log>& others);

}  // namespace dynid::detail
