// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/app/info.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail {

// One word for each, in tables and in JSON.
const char* word_for(JointType type);
const char* word_for(Identifiable answer);

/// Where a payload's centre of mass is, from the flange and in its axes as well as in the last link's frame;
/// empty where the effect is another. The same words for what was simulated and for what was found.
std::string payload_place(const Robot& robot, const Effect& effect);

}  // namespace dynid::detail
