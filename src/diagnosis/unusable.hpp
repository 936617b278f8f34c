// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"
#include "split.hpp"

namespace dynid::detail {

/// What no diagnosis can be built on: torques that are not measured, a velocity that is not that of the
/// positions. scales: n, of the model alone, by which a joint moves or rests.
std::vector<DataIssue> unusable(const std::vector<Log>& logs, const std::vector<PreparedLog>& prepared,
                                const std::vector<JointScale>& scales);
/// One issue where the rows are too few to choose effects by, or to judge them: says how long the logs would
/// have to be. `source`: of the first of `logs`.
std::vector<DataIssue> too_short(const GapRows& rows, const Split& split, const std::string& source,
                                 int logs);

}  // namespace dynid::detail
