// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// Step 11 of the method: horizons of 0.1, 0.5 and 1 s by forward dynamics under the measured torque, without
/// and with the effects, in the rows that are held out (`held_out`, one a row of `rows`). Effects that the
/// model has no place for give their torque along the measured motion. Of a single log, where every other
/// second is held out, the longest horizon starts in such a second and ends in the next.
Rollout roll_out(const Robot& nominal, const std::vector<FoundEffect>& effects, const GapRows& rows,
                 const std::vector<bool>& held_out);

}  // namespace dynid::detail
