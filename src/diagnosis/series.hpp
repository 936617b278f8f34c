// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "judge.hpp"

namespace dynid::detail {

/// The gap over time with the effects taken out, and the stretches in which it is much larger than elsewhere:
/// series and windows of `out`.
void put_series(const Robot& nominal, const GapRows& everything, const Choice& choice, const Judged& judged,
                const std::vector<std::string>& logs, Diagnosis& out);

}  // namespace dynid::detail
