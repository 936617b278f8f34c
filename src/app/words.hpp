// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/app/info.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail {

// One word for each, in tables and in JSON.
const char* word_for(JointType type);
const char* word_for(Identifiable answer);

}  // namespace dynid::detail
