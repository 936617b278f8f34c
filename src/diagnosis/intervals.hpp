// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/diagnose.hpp"
#include "gap_model.hpp"

namespace dynid::detail {

/// Effect `which` of a model fitted over `rows`: estimates with 90 % intervals, coefficients and shapes drawn
/// together from the fit's covariance, which takes in the derivatives with respect to the shapes.
/// Probability, share and aliases are left to others.
FoundEffect found_effect(const Robot& robot, const GapRows& rows, const GapModel& model, std::size_t which,
                         unsigned seed, const Calibration& by);

}  // namespace dynid::detail
