// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rows.hpp"

namespace dynid::detail {

/// Gaps that could as well have been: the same spectra and cross-spectra, no relation to the motion. One
/// phase a frequency, common to the joints; the mean is drawn as if it were one of the lowest frequencies.
/// Stretches are drawn one by one. The same for the same seed.
std::vector<Eigen::MatrixXd> surrogates(const GapRows& rows, const Eigen::MatrixXd& gap, int count,
                                        unsigned seed);

}  // namespace dynid::detail
