// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "cli/command.hpp"

namespace dynid {

/// `dynid identify --servo`: position servos from commands and positions. `robot` may have no path: each
/// joint then stands alone. `out`: model to write, empty for none. Throws as identify_servos().
void identify_servo(const Output& output, const RobotOption& robot, const LogOption& input,
                    const std::vector<std::string>& logs, const std::string& out);

}  // namespace dynid
