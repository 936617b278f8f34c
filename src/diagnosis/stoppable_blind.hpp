// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <vector>

#include "dynid/diagnosis/blind.hpp"

namespace dynid {

/// run_blind() that leaves out the cases that have not begun once `stop` (may be null) is set. An exception
/// out of its progress would not do: it would cancel the loops inside the diagnoses that are under way.
std::vector<BlindCase> run_blind(const Robot& nominal, const BlindOptions& options,
                                 const std::atomic<bool>* stop);

}  // namespace dynid
