// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dynid/diagnosis/answerable.hpp"
#include "dynid/diagnosis/criteria.hpp"
#include "dynid/diagnosis/gap_series.hpp"
#include "dynid/diagnosis/grounds.hpp"
#include "dynid/diagnosis/next_experiment.hpp"
#include "dynid/diagnosis/rollout.hpp"
#include "dynid/identification/conventions.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

enum class Verdict {
  no_gap,
  not_detected,
  explained,
  partly_explained,
  unexplained,
  misread,  ///< the logs do not mean what the model takes them to mean
  data_invalid
};
const char* to_string(Verdict verdict);

class Hypothesis;

/// One number (or several) with its 90 % interval.
struct ParameterEstimate {
  std::string key, unit;
  Eigen::VectorXd value, low, high;
  bool per_joint = false;  ///< one number for each joint of the robot; else of the effect as a whole
};

/// An effect that the diagnosis adopted.
struct FoundEffect {
  Effect effect;       ///< as a model file carries it
  double share = 0.0;  ///< of the explained gap's energy, whatever the order of effects
  double probability = 0.0;
  std::vector<std::string> aliases;  ///< effects that this log cannot tell from it
  std::vector<ParameterEstimate> parameters;
};

/// An effect as a candidate.
struct RankedEffect {
  std::string name;
  double probability = 0.0;  ///< to be the first
  double explained = 0.0;    ///< part of the gap's energy that it explains alone; 0 where it was not compared
};

/// One criterion that decided the verdict.
struct Judgement {
  std::string criterion;  ///< as Criteria, or the options, name it
  double value = 0.0, threshold = 0.0;
  bool passed = false;
  std::string text;  ///< for a person
};

/// A place where the gap is: one joint in one regime of its motion.
struct GapCell {
  int joint = 0;  ///< from 1
  std::string regime;
  double share = 0.0;  ///< of the gap's energy, each joint in units of its floor
  double p_value = 1.0;
};

/// A stretch of a log in which the gap is much larger than elsewhere.
struct GapWindow {
  std::string log;
  double t0 = 0.0, t1 = 0.0;  ///< [s] as the log is stamped
  std::vector<int> joints;
};

/// How far the gap shrinks, on data that neither chose nor fitted anything.
struct Shrink {
  Eigen::VectorXd before, after, floor;  ///< n [N m rms]
  double fraction = 0.0, low = 0.0, high = 0.0;
  bool held_out = true;
};

/// What to do where logs speak another language than the model: see find_conventions().
enum class Reading {
  ask,    ///< stop: Verdict::misread
  apply,  ///< read them as find_conventions() says, and go on
  trust,  ///< do not look
};

struct Calibration;

struct DiagnoseOptions {
  double cutoff = 0.0;                   ///< [Hz] of the band looked at; 0: chosen, at most 10
  std::vector<std::string> withhold;     ///< effects taken out of the library
  std::vector<const Hypothesis*> extra;  ///< effects of one's own, beside the library's; to outlive the call
  int most_effects = 6;
  double tolerance = 0.02;  ///< relative error of the nominal parameters that is not a gap, at most
  Criteria criteria;
  const Calibration* calibration = nullptr;  ///< null: the one that is built in; to outlive the call
  Reading reading = Reading::ask;
  unsigned seed = 1;  ///< of surrogates and intervals
  int surrogates = 199;
  bool replay = true;  ///< replay the motion with the patch, and propose the next experiment
  std::function<void(const std::string& stage, double fraction)> progress;
};

/// The least torque of an effect that would have been named on a log.
struct VisibleSize {
  std::string name;
  int joint = 0;            ///< from 1: of the joint on which it is seen least
  double torque_rms = 0.0;  ///< [N m]
};

struct Diagnosis {
  Verdict verdict = Verdict::no_gap;
  /// Chance that a robot which the model describes within DiagnoseOptions::tolerance shows so large a gap.
  double p_value = 1.0;
  /// Chance that a gap of the same spectrum, unrelated to the motion, is explained as well by any effect: it
  /// tests the gap's phases, not its size.
  double structure_p_value = 1.0;
  ConventionReport conventions;   ///< in which the logs differ from the model's; applied, or the verdict
  std::vector<PreparedLog> logs;  ///< checks of each log; their segments are released
  Eigen::VectorXd rms, floor;     ///< n [N m or N]: of the gap, and of the noise in the band
  Eigen::VectorXd upper;          ///< n [N m or N]: 95 % upper limit of the gap's rms beyond the floor
  Eigen::VectorXd tolerance;      ///< n [N m or N]: of what each joint carries (rms), the part that is no gap
  std::vector<std::string> unit;  ///< n: of the torques of each joint
  std::vector<GapCell> where;
  std::vector<GapWindow> windows;
  std::vector<VisibleSize> smallest_visible;  ///< where no effect is named, of the simple ones
  std::vector<FoundEffect> effects;           ///< largest share first
  std::vector<RankedEffect> ranking;          ///< of every effect, most probable first
  std::vector<ConsideredEffect> considered;   ///< what was weighed, named or not; largest share first
  std::vector<Judgement> judgement;           ///< what decided the verdict
  Shrink shrink;
  GapSeries series;
  Rollout rollout;
  NextExperiment next;
  double nominal_error = 0.0;  ///< relative error of the nominal parameters that the data ask for
  double explained = 0.0;      ///< least part of the gap's energy that they explain, fitted or held out
  double cutoff = 0.0;
  double seconds = 0.0;
  Answerable answerable;  ///< whether the logs can answer, and what could not be seen on them
};

/// Tells where the gap between a nominal model and logs of the real robot lies, which effects make it, and
/// how far it shrinks with them. With several logs the last is held out from choosing and fitting; of one
/// log, every other block. The nominal model's own effects are part of its torque: what is found is beside
/// them. Throws Error on logs that do not fit the robot.
Diagnosis diagnose(const Robot& nominal, const std::vector<Log>& logs, const DiagnoseOptions& options = {});

/// The nominal model with the effects in it: in its own parameters where it has a place for them, in
/// Robot::effects otherwise.
Robot patched(const Robot& nominal, const std::vector<FoundEffect>& effects);

}  // namespace dynid
