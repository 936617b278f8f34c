// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/identification/identify.hpp"
#include "dynid/identification/regression.hpp"

namespace dynid::detail {

/// `logs` prepared and turned into rows, one filter for all. `cutoff` [Hz]: 0 is replaced by the one of the
/// options or, where that is 0 too, by the narrowest band that a log asks for. What was checked and chosen is
/// added to `reports`, without the samples. Throws Error: unusable logs, a number of joints other than the
/// robot's.
std::vector<RegressionRows> rows_of_logs(const Robot& robot, const BaseParameters& base,
                                         const std::vector<Log>& logs, const IdentifyOptions& options,
                                         double& cutoff, std::vector<PreparedLog>& reports);

}  // namespace dynid::detail
