// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "rows.hpp"

namespace dynid::detail {

/// p-value of a gap's structure (rows x n) against surrogates of it: the largest part that any one block
/// explains, each standardised by what it explains of the surrogates (Westfall and Young 1993). It tests the
/// phases of the gap, whatever its size.
double structure_p_value(const GapRows& rows, const std::vector<const RowBlock*>& blocks,
                         const Eigen::MatrixXd& gap, const std::vector<Eigen::MatrixXd>& surrogates);

}  // namespace dynid::detail
