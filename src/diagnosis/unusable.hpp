// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid::detail {

/// What no diagnosis can be built on: torques that are not measured, a velocity that is not that of the
/// positions.
std::vector<DataIssue> unusable(const std::vector<Log>& logs, const std::vector<PreparedLog>& prepared);

}  // namespace dynid::detail
