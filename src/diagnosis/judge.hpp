// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "gap_size.hpp"
#include "rank.hpp"
#include "select.hpp"

namespace dynid::detail {

/// What the judge makes of a choice.
struct Judged {
  GapModel model;              ///< the choice, or what of it holds
  std::vector<double> shares;  ///< of each of its effects
  std::vector<Adopted>
      beside;              ///< what the model's effects were fitted with, and what is too unsure to be named
  double explained = 0.0;  ///< least part of the gap's energy that they explain, fitted or held out
  Ranked ranked;           ///< of the model; its ranking is of what was considered
  std::vector<ConsideredEffect> considered;
  Shrink shrink;  ///< where nothing was chosen or fitted
  bool windowed = false, within = false;
  Verdict verdict = Verdict::no_gap;
  std::vector<Judgement> judgement;
};

/// Whether the effects of a choice are the whole story. `everything`: the rows that were split; `noise`: n
/// [N m rms], the floor; `structure_p_value`: see structure_p_value().
Judged judge(const Choice& choice, const GapRows& everything, const Eigen::VectorXd& noise,
             const GapSize& size, double structure_p_value, const DiagnoseOptions& options);

/// Whether the effects of the verdict are named.
inline bool adopts(Verdict verdict) {
  return verdict == Verdict::explained || verdict == Verdict::partly_explained;
}

}  // namespace dynid::detail
