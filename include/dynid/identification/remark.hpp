// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dynid {

/// What the user of an identification should look at before the model is used: something that no robot has.
struct Remark {
  std::string name;    ///< of the coefficient (`zz1`, `fv3`, `ia2`), `relative_error` or
                       ///< `validation_relative_error`
  int joint = 0;       ///< from 1; 0: the arm
  double value = 0.0;  ///< as in Coefficient (SI); errors: %
  double std = 0.0;    ///< standard deviation of the value, same unit, correlated residuals honoured; 0: none
  std::string text;    ///< one line for people: what it is, and what usually makes it
};

/// When a remark is made.
struct RemarkCriteria {
  /// Standard deviations that a coefficient has to lie on the impossible side of 0. Some 30 signs are looked
  /// at in one identification of seven joints: at 4, noise makes a remark in one of a thousand.
  double significance = 4.0;
  /// [%] of the torque (FitQuality::relative_error_percent). Half of the torque unexplained is far beyond
  /// what noise or friction do (2 to 15 % on working robots), and short of 100 %, which no model at all
  /// reaches.
  double relative_error_percent = 50.0;
};

}  // namespace dynid
