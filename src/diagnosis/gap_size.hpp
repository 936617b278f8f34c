// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/criteria.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// How large the gap is, beside what the noise makes of it. A joint's mean square over rows that are
/// correlated has the spread of chi-squared with N / (1 + 2 sum r_k^2) degrees of freedom, r_k its
/// autocorrelation.
struct GapSize {
  Eigen::VectorXd upper;      ///< n [N m or N]: 95 % upper limit of the gap's rms beyond `floor`
  Eigen::VectorXd tolerance;  ///< n [N m or N]
  /// Chance that a gap within the tolerance on every joint, and noise as large as `floor`, are as large on
  /// any: the joints' by Sidak.
  double p_value = 1.0;
  bool within() const { return (upper.array() <= tolerance.array()).all(); }
};
/// Of the rows that say something (GapRows::moving()): what a joint carries while it sticks is anything
/// within its friction. `floor`: n [N m or N] of the noise; `tolerance`: part of what each joint carries that
/// is no gap.
GapSize gap_size(const GapRows& rows, const Eigen::VectorXd& floor, double tolerance,
                 const Criteria& criteria);

}  // namespace dynid::detail
