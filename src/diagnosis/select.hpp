// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "search.hpp"
#include "split.hpp"

namespace dynid::detail {

using Say = std::function<void(const char* stage, double fraction)>;

/// The effects that one part of the rows shows, and the part that judges them. Not to be copied: the search
/// refers to the rows.
class Choice {
 public:
  /// Chooses. The split has least_to_fit and least_to_judge rows, or more.
  Choice(const GapRows& everything, const Split& split, const std::vector<const Hypothesis*>& library,
         const DiagnoseOptions& options, const Say& say);
  /// What was chosen in a spread of windows, with all rows to fit and to judge it. Holds a reference to
  /// `sought`.
  Choice(const GapRows& everything, const Split& split, const Choice& sought);
  Choice(const Choice&) = delete;
  Choice& operator=(const Choice&) = delete;

  /// What was chosen leaves a gap in the rows that judge, and none where it was chosen.
  bool left_in_held(double tolerance) const;
  /// What was chosen leaves a gap, where it was chosen or where it is judged.
  bool leaves_gap(double tolerance) const;
  /// Channels are late by what shows, and that is not all that there is.
  bool lateness_matters() const;
  const Criteria& criteria() const { return search.criteria(); }

  Split split;
  const GapRows rows, held;
  Search search;
  GapModel model;

 private:
  /// How far off the nominal parameters are is found along with the effects: an error of the model must not
  /// be named an effect, nor an effect be taken for such an error.
  double tuned(const std::vector<std::vector<Adopted>>& sets, double tolerance) const;
  /// A body that was found first, with a nominal that is right, takes the place of a nominal that is off for
  /// good: where that was never identified, sought again with one that is off, beginning with the effects
  /// that are no body.
  void begin_with_errors(const DiagnoseOptions& options, Trail& trail);
  /// When something began, how fast, and when it ended is not predicted but seen: that of windows becomes
  /// what all rows fit best, since in a log alone it may lie in what is kept to judge.
  void settle_windows(const GapRows& everything);
  /// Grows sets from other first effects than that of `trail`: one step after the other leads to where the
  /// first one led. Whether one is better; it is then the choice.
  bool begun_elsewhere(int most, const Trail& trail);
  /// Beside an effect that does not come back, others have to hold where it is not. Whether the model is
  /// another.
  bool keep_what_holds();
};

/// The whole selection. Where channels are late, what other effects add there is late too: `everything` is
/// then made late as well.
std::unique_ptr<Choice> select(GapRows& everything, const Split& split,
                               const std::vector<const Hypothesis*>& library, const DiagnoseOptions& options,
                               const Say& say);

}  // namespace dynid::detail
