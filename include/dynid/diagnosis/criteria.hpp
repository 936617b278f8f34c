// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// Every threshold of the diagnosis, with where it comes from. Log evidence is in nats; parts are of energy.
/// "Banks" are those of `dynid blind`, clean and nominal kinds; none of the values is fitted to a real log.
struct Criteria {
  // -------------------------------------------------------------------------------------- is there a gap
  /// p-value below which a gap is said to be there: the usual one in twenty.
  double detection = 0.05;
  /// A gap of one log alone is left over where it is larger than this many times the white floor, or than all
  /// of the white noise of the samples: coloured noise of realistic sensors stayed below 3 on the banks, at
  /// rates at which the filter leaves a quarter of the white noise or more.
  double left_over = 4.0;
  /// Coloured noise, in the same measure, that the floor may be raised by.
  double floor_room = 3.0;
  /// A joint is taken to carry at least this part of what the most loaded joint carries: one that carries
  /// nothing (the first of an upright arm, a wrist) would otherwise have no tolerance at all, and coloured
  /// sensor noise of 0.03 N m on an arm that carries 30 would be a gap.
  double least_load = 0.1;

  // --------------------------------------------------------------------------------------- what may be named
  /// Form error of an approximate effect, and of an exact one, in parts of its torque: what a Stribeck curve
  /// leaves of a LuGre joint, or a smoothed sign of a real reversal, is as large. It is added to the variance
  /// that a further effect is judged by, and a further effect has to explain more than its energy, of a
  /// joint's gap.
  double form_of_approximate = 0.2, form_of_exact = 0.03;
  /// An effect is named where it is more likely than not, and `explained` is said where all are.
  double least_probability = 0.5;
  /// `explained` is said where the gap shrinks by this part, on data that neither chose nor fitted anything;
  /// a set that explains less is no answer: the gap is unexplained.
  double least_shrink = 0.65;
  /// Where the gap is within the tolerance, or may be noise, an effect is named only where it is this
  /// probable: of what was weighed in the healthy cases of 23 banks (`dynid blind`, those of the calibration
  /// and of seeds 20201, 20202, 20206 and 20301), all but two had at most 0.71; of those, one (0.76) did not
  /// shrink the gap, and one (0.78) explained none of it where it was judged. So is one whose share is below
  /// least_share, however much of one joint's gap it is.
  double least_probability_within = 0.75;
  /// A joint sticks where its speed is below this many times what its own sensor resolves.
  double at_rest = 3.0;
  /// A share below this, of the explained gap and of every joint's own, is none: what forms, filters and the
  /// errors of the nominal leave beside a large effect is as large, and a hundredth of the gap is no answer
  /// to which knob to turn. Below a tenth of it, of the explained gap, it has to be least_gain of a joint's
  /// own: on a joint that has none of the large ones it is all there is to find.
  double least_share = 0.01;

  // ------------------------------------------------------------------------------------------ which effects
  /// Log evidence that a further effect has to bring beyond its price: odds of e^10 before the calibration's
  /// temperature, about ten to one after it.
  double effect_gain = 10.0;
  /// And that a further joint of an effect has to bring.
  double joint_gain = 6.0;
  /// Weight of an effect's prior: rows are not as independent as the evidence takes them to be.
  double prior_weight = 4.0;
  /// By how much the nominal's parameters may be off, in tolerances, and the log evidence that this has to
  /// bring. A model without any friction was never identified: its inertials are a vendor's, and may be off
  /// by a tenth. Where a body is found beside one, which links that are off imitate, the search begins again
  /// with both.
  double most_off = 1.5, never_identified = 5.0, off_gain = 2.0;
  /// Part of what is left of a joint's gap that a further effect has to explain.
  double least_gain = 0.25;
  /// Part of the gap that a delay has to explain for the search to begin again with it, the change of that
  /// delay that is one, in parts of the time between rows, and the log evidence that the set found with it
  /// has to bring.
  double least_of_delay = 0.02, same_delay = 0.025, least_better = 1.0;
  /// Log evidence, over the calibration's temperature, within which two effects are not told apart: e^-4 to
  /// one is one in fifty.
  double indistinct = 4.0;

  // ----------------------------------------------------------------------------------------- long logs
  /// Rows that effects are sought in, of all logs together: where the logs have more, a spread of windows is
  /// searched, and what is found there is fitted and judged on all rows. What 3200 rows (two logs of a
  /// minute) do not tell apart, more of the same motion seldom does.
  int searched_rows = 3200;
  /// Rows of a window of the spread: ten times what the filter takes of its ends together, so that little is
  /// lost to them.
  int window_rows = 200;
  /// Part of the windows that are those with the largest gap, for what passes; the others cover what the
  /// joints do, and the time.
  double loud_windows = 0.25;
  /// An effect's shape is refined between the points of its grid where the best of them brings this part of
  /// the log evidence that the effect has to bring.
  double worth_refining = 0.25;

  // -------------------------------------------------------------------------------- is it the whole story
  /// What is left does not matter where this part is explained.
  double fully_explained = 0.9;
};

}  // namespace dynid
