// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// An effect from `NAME[:key=value,...]`, completed. Joints are `joints=1+3+5` (left out: all); a value of
/// several numbers is `com=0.01:0.02:0.1`; a parameter over joints takes one number for all of `joints` or
/// one for each of them. Throws Error as complete_effect() does.
Effect parse_effect(const std::string& text, const Robot& robot);

}  // namespace dynid
