// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/grounds.hpp"
#include "select.hpp"

namespace dynid::detail {

/// The form error of all effects of a model, as variances: of each joint's torque, and through its noise's
/// filter. That of effect `but` is left out.
struct FormError {
  Eigen::VectorXd size, innovation;
};
FormError form_error(const Choice& choice, const GapModel& model, std::size_t but = std::size_t(-1));

/// The grounds of every effect of a set, but for Ground::evidence and Ground::unlike, which are a matter of
/// the others that could stand in its place. `shares`: of the effects; `floor`: n [N m or N].
std::vector<Grounds> grounds_of(const Choice& choice, const GapModel& model,
                                const std::vector<double>& shares, const Eigen::VectorXd& floor);

}  // namespace dynid::detail
