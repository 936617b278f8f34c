// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/criteria.hpp"
#include "rows.hpp"

namespace dynid::detail {

/// Rows of held-out blocks and of the bootstrap's, and of blocks inside a window: not so few that nearly all
/// are next to the end of a block, or that a block has no past to whiten by.
constexpr double block_rows = 25.0, within_rows = 10.0;

/// [s] The same.
inline double block_length(const GapRows& rows) { return block_rows * rows.period(); }
inline double within_length(const GapRows& rows) { return within_rows * rows.period(); }

/// Rows without which nothing is chosen, and none judged.
constexpr Eigen::Index least_to_fit = 40, least_to_judge = 10;

/// Rows in every other block of `seconds`, `apart` rows from each change.
std::vector<bool> alternate(const GapRows& rows, bool odd, double seconds, Eigen::Index apart);

/// What chooses and fits, and what only judges: of several logs the last judges, of one every other block,
/// those with less of the gap: what passes is fitted where most of it is.
struct Split {
  std::vector<bool> to_fit, to_judge;  ///< of each row
  bool several = false;                ///< logs
  /// What shows in one log alone (a contact, a limit that the others never meet) is sought there, judged
  /// within it, and must do no harm to the others.
  bool alone = false;
  bool odd_fit = false;  ///< of a log alone: the blocks that fit are the second, the fourth and so on
  Split swapped() const { return {to_judge, to_fit, several, true, odd_fit}; }
};
/// `logs`: their number; `tolerance`: relative error of the nominal parameters that is no gap.
Split split(const GapRows& rows, int logs, double tolerance, const Criteria& criteria);
/// The split of windows, over all rows that they are of.
Split over_all(const GapRows& rows, int logs, const GapRows& windows, const Split& of_windows);

}  // namespace dynid::detail
