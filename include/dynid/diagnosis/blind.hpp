// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid {

enum class BlindKind {
  clean,    ///< white sensor noise
  nominal,  ///< true parameters off by 2 %, coloured noise, jittered stamps, lost packets
  weak,     ///< as clean, effects at 0.3 times their size
  /// As `nominal`, the model a vendor's: no friction, no rotor inertia, the inertials 5 % (every other case:
  /// 10 %) off, and in half of the cases one more effect.
  vendor,
  mixed,  ///< clean, nominal and weak in turn
};

struct BlindOptions {
  int cases = 20;
  unsigned long seed = 1;
  BlindKind kind = BlindKind::clean;
  /// Each case has an arm, a motion, a rate, a duration and a number of logs of its own, drawn by
  /// random_family_robot() and random_family_run(), and 0 to 3 effects; the nominal robot, `duration` and
  /// `rate` are not used.
  bool family = false;
  /// The nominal robot is the arm of every case of the family: all else is drawn. Needs its limits.
  bool given_robot = false;
  /// Where logs (with, in the family, each case's nominal model) and, apart from them, labels are written.
  std::string folder;
  double duration = 12.0;  ///< [s] of each of a case's two logs
  double rate = 250.0;     ///< [Hz]
  DiagnoseOptions diagnose;
  std::function<void(int done, int of)> progress;  ///< serialised
  /// Cases that have not begun are left out once it is set; may be null. An exception out of `progress` would
  /// not do: it would cancel the loops inside the diagnoses that are under way.
  const std::atomic<bool>* stop = nullptr;
};

/// One case: what was put in, and what came out.
struct BlindCase {
  std::vector<Effect>
      truth;  ///< empty: no gap; the name of one that the library does not have starts with `unknown`
  std::vector<double> truth_shares;  ///< of each in the gap's energy, joints scaled by their torque ranges
  /// What was put in is within the tolerance of what each joint carries: `no_gap` is then the answer.
  bool within_tolerance = false;
  std::vector<std::string> background;  ///< effects that are there too, and may be named or not
  bool vendor = false;
  std::map<std::string, std::string> drawn;  ///< what else was drawn, for a person
  std::vector<std::string> withheld;         ///< effects taken out of the library for it
  Verdict verdict = Verdict::no_gap;
  double p_value = 1.0, explained = 0.0;
  std::vector<FoundEffect> found;
  std::vector<ConsideredEffect> considered;
  std::vector<std::pair<std::string, double>> ranking;
  double shrink = 0.0;       ///< of the diagnosis, on the log that took no part
  double true_shrink = 0.0;  ///< the same with nothing but the true effects to choose from
  /// Of the truth, what is named with nothing but the true effects to choose from. The rest is missed for
  /// other reasons than that another effect took its place: it is below the noise, what an error of the
  /// nominal may be, or not sure enough.
  std::vector<std::string> attainable;
  double nominal_error = 0.0;
  double seconds = 0.0;
  std::string failure;  ///< what was thrown, if anything
};

/// A 90 % interval beside the truth.
struct ComparedInterval {
  std::string parameter;
  double value, low, high, truth;
  double scale;  ///< of the value: a joint's own, or the length of a vector
};
/// Those of the first effect's parameters, where it is the one that was put in, and its joints are right.
std::vector<ComparedInterval> compared_intervals(const BlindCase& c);

/// The figures of the check over a bank.
struct BlindScore {
  int failures = 0;  ///< cases that threw; counted nowhere else
  int cases = 0, no_gap = 0, false_alarms = 0;
  int known = 0, first_right = 0, class_right = 0, joints_right = 0;  ///< cases with effects of the library
  int unknown = 0, abstained = 0;                                     ///< cases with effects not of it
  int pairs = 0, both_found = 0;
  int confident_wrong = 0;         ///< wrong first effect with probability of 0.9 or more, of all cases
  double calibration_error = 0.0;  ///< ECE of the first effect's probability, ten bins
  int intervals = 0, covered = 0;  ///< 90 % intervals of the first effect's parameters, where right
  double parameter_error = 0.0;    ///< median relative error of those parameters
  double shrink = 0.0;             ///< median over the cases with effects of the library
  double shrink_of_true = 0.0;     ///< median part of what the true effects give

  // Over all effects named, in all cases, not the first alone. One is there when the truth has its name.
  int named = 0;
  int named_confident = 0, confident_not_there = 0;  ///< at 0.9 or more
  int named_likely = 0, likely_not_there = 0;        ///< at 0.5 to 0.9
  double likely_claimed = 0.0;                       ///< sum of the probabilities of these
  double calibration_error_all = 0.0;                ///< ECE of all, ten bins
  int clean_verdicts = 0;                            ///< of `no_gap`: called no_gap or not_detected
  int healthy_confident = 0;                         ///< of `no_gap`: an effect named at 0.9 or more
  int unknown_confident = 0;                         ///< of `unknown`: the same
  int triples = 0, all_three_found = 0;
  int known_unexplained = 0;  ///< of `known`, called unexplained
  /// Of `known`, those within the tolerance, and of these, called no_gap or not_detected.
  int known_within = 0, known_within_clean = 0;
  // Of what is attainable (BlindCase): cases of `known` with such an effect, and of two where both are; and
  // effects, of all of `known`.
  int known_attainable = 0, first_right_attainable = 0;
  int pairs_attainable = 0, both_found_attainable = 0;
  int attainable = 0, attainable_named = 0;
  // Vendor's models: viscous, Coulomb and rotor inertia with 2 % of the gap; the further effect with 3 %.
  int vendor_main = 0, vendor_main_named = 0, vendor_further = 0, vendor_further_named = 0;
  double vendor_friction_error = 0.0;  ///< median relative error of the friction coefficients named
  std::map<std::string, std::map<std::string, int>> confusion;  ///< truth, named
};

/// Draws a bank with simulation/, writes its logs to `folder`/logs and its labels to `folder`/sealed, lets
/// diagnose() see the logs alone, then opens the labels. Cases run on all cores; the same for the same seed
/// whatever their number. Throws Error where the folder cannot be written.
std::vector<BlindCase> run_blind(const Robot& nominal, const BlindOptions& options);
BlindScore score(const std::vector<BlindCase>& cases);

/// The figures over all effects and of vendors' models, by the name of the field, for a file.
std::map<std::string, double> further_figures(const BlindScore& score);

}  // namespace dynid
