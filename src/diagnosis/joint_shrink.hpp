// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid::detail {

/// Shrink joint by joint, along the rows of GapSeries that are held out; an interval of 90 % by blocks of a
/// second.
struct JointShrink {
  Eigen::VectorXd before, after;        ///< n [N m or N rms]
  Eigen::VectorXd fraction, low, high;  ///< n, of the energy beyond the floor; NaN where a joint has no gap
};

/// How far each joint's gap shrinks along the held-out rows of `series`. floor: n [N m or N]. Where no row is
/// held out, zeros, and no fractions.
JointShrink joint_shrink(const GapSeries& series, const Eigen::VectorXd& floor, unsigned seed);

}  // namespace dynid::detail
