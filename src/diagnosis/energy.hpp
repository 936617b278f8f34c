// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/criteria.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// Root mean square of each column.
Eigen::VectorXd rms(const Eigen::MatrixXd& x);
/// Energy in units of the floor (n), joints pooled, a row.
double energy(const Eigen::MatrixXd& x, const Eigen::VectorXd& floor);
/// Part of the energy beyond each joint's floor that is gone, at most 1; 0 where there is none before.
double shrink_fraction(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
                       const Eigen::VectorXd& floor);
/// `after` is larger than `before`, block by block: what happens once, however large, does not decide.
bool worse(const GapRows& rows, const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
           const Eigen::VectorXd& floor);
/// What each joint carries: n [N m rms], not less than a part of what the most loaded one does.
Eigen::VectorXd carried_load(const GapRows& rows, const Criteria& criteria);
/// More than coloured noise and the nominal's own errors, where it has any (`tolerance`, relative), may
/// leave.
bool left_over(const GapRows& rows, const Eigen::MatrixXd& residual, double tolerance,
               const Criteria& criteria);

}  // namespace dynid::detail
