// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dynid {

/// What gnuplot draws from `commands` (their terminal: svg, their output: the standard one), from `<svg` on,
/// to stand in an HTML page; empty where there is no gnuplot on this machine or it refuses the commands.
/// `name` [a-z0-9_] makes the ids of several drawings in one page different.
std::string plot_svg(const std::string& commands, const std::string& name);

}  // namespace dynid
