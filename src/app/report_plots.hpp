// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid::detail {

/// Drawing of the gap of joint `joint` (from 0) over time in log `log` (from 0), before and after, with the
/// noise floor and what was held out: an <svg> in the page's colours. Empty without gnuplot or rows.
std::string gap_plot(const Diagnosis& d, Eigen::Index joint, int log);

/// One joint's replayed position (within what was measured, and half as much again) or its error, the same
/// way.
std::string replay_plot(const Rollout& r, Eigen::Index joint, bool error);

}  // namespace dynid::detail
