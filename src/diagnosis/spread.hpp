// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/criteria.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// The windows of long logs that effects are sought in, in the order of their rows: of each log as many, some
/// where its gap is largest, the others so that they cover what its joints do, and then its time.
std::vector<RowWindow> spread_windows(const GapRows& rows, const Criteria& criteria);

}  // namespace dynid::detail
