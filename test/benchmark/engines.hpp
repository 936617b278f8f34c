// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/model/robot.hpp"

/// States that every engine goes through in one iteration of a benchmark.
inline constexpr int samples = 1024;

/// Registers the benchmarks `quantity/engine` on a robot of seven revolute joints; returns the largest
/// relative difference between the engines' answers over all states.
double register_benchmarks(const dynid::Robot& robot);

/// The version of Pinocchio that is compared, or null.
const char* pinocchio_version();
