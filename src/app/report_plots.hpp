// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "page_plots.hpp"

namespace dynid::detail {

/// The gap of every joint over time in log `log` (from 0), before and after, with the noise floor and what
/// was held out; shown at first are the first of `order` (joints from 0). No plots without rows.
PlotGroup gap_plots(const Diagnosis& d, const std::vector<std::size_t>& order, int log);

/// The replayed position of every joint (within what was measured, and half as much again) and its error;
/// shown at first are the first of `order`.
PlotGroup replay_plots(const Rollout& r, const std::vector<std::size_t>& order);

}  // namespace dynid::detail
