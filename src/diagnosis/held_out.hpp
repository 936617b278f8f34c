// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/diagnose.hpp"
#include "gap_model.hpp"

namespace dynid::detail {

/// How far the gap of the rows shrinks when `after` (rows x n) is left of it, with a 90 % interval from
/// blocks drawn with replacement.
Shrink shrink_of(const GapRows& rows, const Eigen::MatrixXd& after, const Eigen::VectorXd& floor,
                 unsigned seed);
/// What an effect adds in rows that are to judge it (`there`) is enough to: more than noise, and than a small
/// part of what it adds in those where it was found. Both rows x n.
bool shows(const Eigen::MatrixXd& there, const Eigen::MatrixXd& found, const Eigen::VectorXd& floor);
/// A contact does not come again: its window is fitted in every other block and judged in those between.
GapModel fitted_within(const GapRows& rows, const GapModel& model);
Shrink shrink_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor, unsigned seed);
/// Part of the gap that is explained so, by the effects or by the nominal model's errors beside them.
double explained_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor);

}  // namespace dynid::detail
