// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid {

/// Every threshold of the diagnosis of servo logs, with its reason. Evidence is in nats; parts are of the
/// mean loss of a joint's open-loop motion error unless said otherwise. None is an angle, a speed, a torque
/// or a time.
struct ServoCriteria {
  /// p-value below which a gap is said to be there: the usual one in twenty.
  double detection = 0.05;
  /// What the count of independent samples is divided by: no model of friction is exact, so that the error
  /// left is not noise, however little of it correlates.
  double temperature = 4.0;
  /// Evidence that an effect has to bring beyond its price: odds of e^3, twenty to one.
  double effect_gain = 3.0;
  /// Evidence within which two effects are not told apart: e^-2 to one is one in eight.
  double indistinct = 2.0;
  /// Evidence by which a rival has to fall short on the rows searched to be looked at no more on all rows:
  /// odds of e^8 are more than the coarser steps of the search and the rows that judge turn round.
  double ruled_out = 8.0;
  /// Evidence, of rows that fit and rows that judge together, with which a rival takes an effect's place: e
  /// to one, so that nothing goes to and fro.
  double replaces = 1.0;
  /// Part by which an effect has to lower the mean loss on each half of the data in turn, when fitted on the
  /// other: a twentieth is what the loss of one log changes by when nothing is missing. Of the gap's energy a
  /// smaller part is no explanation, not even partly.
  double least_gain = 0.05;
  /// A share below this of what is explained on every one of its joints is none.
  double least_share = 0.02;
  /// An effect is named where it is more likely than not.
  double least_probability = 0.5;
  /// Where a joint's fit leaves more than this many times the noise, the forms are not the robot's, and no
  /// name is surer than `most_probable`: on a real SO-101 two sets of motions agree on the size of what is
  /// off, and on less than all of the names. Nor is one on a joint whose gap, by its size, may be that of a
  /// nominal model within the tolerance: there only the gap's shape speaks for the effect.
  double form_error = 2.0, most_probable = 0.85;
  /// Standard deviation, in parts of itself, below which no size of an effect of a joint is known: the form
  /// is not the robot's. Set on the banks `blind --servo --family` of seeds 171001, 171002 and 171004.
  double form_of_size = 0.01;
  /// `explained` is said where every effect named has `least_probability`, the gap's energy shrinks by this
  /// part on data that took no part ...
  double least_shrink = 0.65;
  /// ... and what is left is below this many times noise and tolerance, or the shrink is this large.
  double left_over = 4.0, fully_explained = 0.9;
  /// [nats] of nominal parameters that move within the tolerance, from which on a gap within it by size is
  /// searched all the same: half of a sum of squares that some five normal numbers exceed once in a hundred
  /// cases.
  double unlikely_change = 7.5;
  /// Part of such a gap's energy that an effect may leave: a rigid body that is off within the tolerance
  /// leaves more beside any effect that mimics it.
  double most_left = 0.05;
  /// The same where what is left is below `form_error`: it explains at least as much as it leaves.
  double most_left_of_noise = 0.5;
  int most_effects = 5;  ///< on one joint: what five parameters do not explain, a sixth seldom does
  /// Rows that effects are sought in, of all logs together; the final fit is on all.
  int searched_rows = 4000;
};

struct DiagnoseServosOptions {
  double tolerance = 0.02;            ///< relative error of the nominal parameters that is not a gap, at most
  std::vector<std::string> withhold;  ///< effects taken out of the library
  ServoCriteria criteria;
  bool rollout = true;  ///< replay short horizons too
  std::function<void(const std::string& stage, double fraction)> progress;
};

/// The names of the effects that a log of commands and positions can show, those of servos first.
const std::vector<std::string>& servo_effect_names();

/// Tells where the motion that a model with servos makes of logged commands leaves the measured one, which
/// effects make the difference, and how far it shrinks with them.
///
/// A joint that no command moves is not searched: where it sticks is any place within its friction.
///
/// nominal: every joint has a servo. logs: t [s], u and q [rad or m], N x n each; of several the last only
/// judges, of one the last part of each half; so of several where no joint's gap is in the last as well as in
/// the others. The residual is q less the open-loop replay (replay_servos()); Diagnosis::rms and the rest of
/// the gap are in the unit of the position. Joint by joint the nominal parameters may move within the
/// tolerance (a Gaussian prior), and an effect frees its own from that; output error with analytic
/// sensitivities, Huber's loss.
///
/// Throws Error: a joint without servo, and as identify_servos(). Runs on oneTBB; the result does not depend
/// on the number of threads.
Diagnosis diagnose_servos(const Robot& nominal, const std::vector<Log>& logs,
                          const DiagnoseServosOptions& options = {});

/// The nominal model with effects of diagnose_servos() in it: in its servos, bodies and gravity, and in
/// Robot::effects where these have no place for them (joint_spring, backlash). replay_servos() knows all of
/// it.
Robot patched_servos(const Robot& nominal, const std::vector<FoundEffect>& effects);

/// The gap is one of motion: the diagnosis is of servo logs.
inline bool of_motion(const Diagnosis& d) {
  return !d.unit.empty() && (d.unit.front() == "rad" || d.unit.front() == "m");
}

}  // namespace dynid
