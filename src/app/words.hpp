// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/app/info.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail {

// One word for each, in tables and in JSON.
const char* word_for(JointType type);
const char* word_for(Identifiable answer);

/// One unit for all joints, or each one's, base to tip.
std::string units_in_words(const std::vector<std::string>& unit);
/// Of the joints' torques: `N m`, or for example `N m | N m | N`.
std::string torque_units(const Robot& robot);
/// Of the joints' positions.
std::string position_units(const Robot& robot);

/// Where a payload's centre of mass is, from the flange and in its axes as well as in the last link's frame;
/// empty where the effect is another. The same words for what was simulated and for what was found.
std::string payload_place(const Robot& robot, const Effect& effect);

}  // namespace dynid::detail
