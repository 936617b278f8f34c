// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "select.hpp"

namespace dynid::detail {

/// What the judge makes of a choice.
struct Judged {
  GapModel model;              ///< the choice, or what of it holds
  std::vector<double> shares;  ///< of each of its effects
  double explained = 0.0;      ///< least part of the gap's energy that they explain, fitted or held out
  Shrink shrink;               ///< within a window or the only log that shows the gap; else not yet found
  bool windowed = false, within = false;
  Verdict verdict = Verdict::no_gap;
  std::vector<Judgement> judgement;
};

/// Whether the effects of a choice are the whole story. `noise`: n [N m rms], the floor.
Judged judge(const Choice& choice, const Eigen::VectorXd& noise, double p_value,
             const DiagnoseOptions& options);

/// Whether the effects of the verdict are named.
inline bool adopts(Verdict verdict) {
  return verdict == Verdict::explained || verdict == Verdict::partly_explained;
}

}  // namespace dynid::detail
