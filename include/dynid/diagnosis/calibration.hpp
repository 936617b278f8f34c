// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dynid/diagnosis/blind.hpp"
#include "dynid/diagnosis/grounds.hpp"

namespace dynid {

/// What makes the probabilities and intervals of a diagnosis mean what they say: fitted once on a simulated
/// bank, never on cases that are reported. config/diagnosis_calibration.yaml is built into the library.
struct Calibration {
  double temperature = 4.0;  ///< scores are log probabilities times this
  /// Weights of the grounds of an effect, and of 1: its probability is the logistic function of their sum.
  Grounds weights;
  double weight_of_one = 0.0;
  /// And by the effect's name: what imitates others is named without being there more often than what does
  /// not.
  std::map<std::string, double> weight_of_name;
  double interval_factor = 1.0;      ///< of standard deviations, where the nominal model is right
  double interval_factor_off = 1.0;  ///< and where it is off
  /// Of "effect.parameter": how far the truth may be off, at 90 %, for having another form than the effect's,
  /// in units of scale(). What is not listed has `form_error`.
  std::map<std::string, double> form_errors;
  double form_error = 0.0;

  /// What the arms and logs of the bank were: `joints`, `rate_hz`, `duration_s`, `logs`, from and to. Beyond
  /// it, probabilities and intervals are extrapolated. Empty: not known.
  std::map<std::string, std::pair<double, double>> family;

  /// What a form error of element `i` is relative to: a joint's own value, or a vector's length. A time, an
  /// angle and a place have no size, only an origin: 1 s, 1 deg, 1 rad or 1 m.
  static double scale(const ParameterEstimate& e, Eigen::Index i) {
    for (const char* unit : {"s", "deg", "rad", "m"})
      if (e.unit == unit) return 1.0;
    return e.per_joint ? std::abs(e.value[i]) : e.value.norm();
  }
  /// Probability that an effect of a set is there.
  double probability(const std::string& name, const Grounds& grounds) const;
  /// Of parameter `parameter` of effect `effect`, in units of scale().
  double form_error_of(const std::string& effect, const std::string& parameter) const {
    const auto found = form_errors.find(effect + "." + parameter);
    return found != form_errors.end() ? found->second : form_error;
  }
};

/// The one that is built in.
const Calibration& calibration();
/// The one that `options` ask for.
inline const Calibration& calibration(const DiagnoseOptions& options) {
  return options.calibration != nullptr ? *options.calibration : calibration();
}
/// A calibration file, as calibration_yaml() writes it. Throws Error naming file, line and key.
Calibration read_calibration(const std::string& path);
/// The same from a text; `name` stands for the file in what an Error says.
Calibration parse_calibration(const std::string& text, const std::string& name);
/// In what these logs lie outside the family that the calibration was fitted to; empty: in nothing.
std::vector<std::string> outside_family(const Calibration& calibration, const std::vector<Log>& logs);

/// What fits the cases of a bank best: the weights by logistic regression on every effect that was weighed,
/// named or not, each weight being pulled to 0 as if by a normal prior (the temperature stays); of
/// each parameter the 90 % quantile of what its errors are beyond the factors' part (form errors; values of
/// one case count as one), and the least factors, not below 1, with which nine in ten intervals hold the
/// truth of a case left out. Throws Error on fewer than 30 cases with an effect
/// weighed.
Calibration fit_calibration(const std::vector<BlindCase>& cases);
/// Text of a calibration file; `command` is the one that made it.
std::string calibration_yaml(const Calibration& calibration, const std::string& command);

}  // namespace dynid
