// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/app/compare.hpp"

namespace dynid::detail {

/// What of a diagnosis (dynid-diagnosis-1) is compared. Throws Error naming the entry.
ComparedDiagnosis compared(const CompareJob::Entry& entry);

}  // namespace dynid::detail
