// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "dynid/identification/regression.hpp"

namespace dynid::detail {

/// Square roots of row weights, N x n, one a log; 0 leaves a row out.
using RowWeights = std::vector<Eigen::MatrixXd>;

/// Ones.
RowWeights all_rows(const std::vector<RegressionRows>& rows);

/// `weights` without the blocks, of `folds` contiguous ones that every log is cut into, that `out` chooses,
/// nor the rows that share data with them.
RowWeights without(const std::vector<RegressionRows>& rows, const RowWeights& weights, int folds,
                   const std::function<bool(int block)>& out);

/// `weights` within these blocks alone.
RowWeights only(const std::vector<RegressionRows>& rows, const RowWeights& weights, int folds,
                const std::function<bool(int block)>& out);

/// Rows of joint j that take part.
Eigen::Index rows_in(const RowWeights& weights, int j);

/// `weights` where a residual beyond 1.345 robust standard deviations of its joint counts less (Huber 1964:
/// 95 % as efficient as least squares on normal noise). `residuals`: N x n, one a log.
RowWeights huber_weights(const RowWeights& weights, const std::vector<Eigen::MatrixXd>& residuals);

}  // namespace dynid::detail
