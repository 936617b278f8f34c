// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "identification/servo_data.hpp"

namespace dynid::detail {

/// Parts of the rigid body's torque at a joint that a fit may turn: what its bodies may be off by moves few
/// shapes of torque along a motion, whatever the number of links.
constexpr int servo_load_parts = 6;

/// Fills ServoSeries::parts, by joint and log: the torques by which a joint's load changes where every link
/// is off as perturbed() makes it, by `tolerance`; principal components over all logs' rows, each by one
/// standard deviation. Series without a load get none.
void add_load_parts(const Robot& nominal, const std::vector<Log>& logs, double tolerance,
                    std::vector<std::vector<ServoSeries>>& series);

}  // namespace dynid::detail
