// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// Regimes of a motion, joint by joint: which rows (of joint j) are in which, 0 or 1.
struct Regime {
  std::string name;
  Eigen::MatrixXd inside;  ///< rows x n
};
std::vector<Regime> regimes(const GapRows& rows);

/// Step 10: the gap's energy by joint and regime, in units of `floor` [N m, n], beside what surrogates have
/// there: p of the cell's energy per row, beyond chance.
std::vector<GapCell> locate(const GapRows& rows, const Eigen::VectorXd& floor,
                            const std::vector<Eigen::MatrixXd>& surrogates);

/// Stretches in which the gap of some joints is far above what it is over the rest of the log.
std::vector<GapWindow> windows(const GapRows& rows, const Eigen::MatrixXd& gap,
                               const std::vector<std::string>& logs);

}  // namespace dynid::detail
