// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/criteria.hpp"
#include "rows.hpp"

namespace dynid::detail {

constexpr double block_seconds = 1.0;   ///< of held-out blocks and of the bootstrap
constexpr double within_seconds = 0.4;  ///< of blocks inside a window

/// [s] The same, but never so short that the rows of a log that is sampled slowly are nearly all next to the
/// end of a block, or that a block has no past to whiten by.
double block_length(const GapRows& rows);
double within_length(const GapRows& rows);

/// Rows in every other block of `seconds`, with a guard of `guard` rows before and after each change.
std::vector<bool> alternate(const GapRows& rows, bool odd, double seconds, Eigen::Index guard);

/// What chooses and fits, and what only judges: of several logs the last judges, of one every other block.
struct Split {
  std::vector<bool> to_fit, to_judge;  ///< of each row
  bool several = false;                ///< logs
  /// What shows in one log alone (a contact, a limit that the others never meet) is sought there, judged
  /// within it, and must do no harm to the others.
  bool alone = false;
  Split swapped() const { return {to_judge, to_fit, several, true}; }
};
/// `logs`: their number; `tolerance`: relative error of the nominal parameters that is no gap.
Split split(const GapRows& rows, int logs, double tolerance, const Criteria& criteria);
/// The split of windows, over all rows that they are of.
Split over_all(const GapRows& rows, int logs, const GapRows& windows, const Split& of_windows);

}  // namespace dynid::detail
