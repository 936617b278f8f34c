// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_payload.hpp"
#include "servo_search.hpp"

namespace dynid::detail {

/// One joint of the answer: its effects, fitted on all rows that fit, and how likely each is.
struct ServoAnswer {
  ServoProblemOfJoint problem;  ///< whole logs
  ServoChoice choice;
  std::vector<int> effects;         ///< of servo_effects()
  std::vector<double> probability;  ///< of each
  std::vector<std::vector<std::string>> aliases;
  KnobFit fit;
  double samples = 0.0;
  bool within_tolerance = false;  ///< the joint's gap, by its size: only its shape speaks for an effect
};

/// What the search said of one of the effects that it chose.
const WeighedServoEffect& weighed(const ServoAnswer& answer, int effect);
/// The nominal knobs, those of `effects` as in `x`.
Knobs only(const Knobs& nominal, const Knobs& x, const std::vector<int>& effects);

/// Fits the chosen effects on all rows, drops what the judging rows do not bear out, and weighs the rest.
void judge_servo(ServoAnswer& answer, const ServoCriteria& criteria);

/// Probability of log evidence `gain` beside rivals that fall short by the first of each.
double probability_of(double gain, const std::vector<std::pair<double, std::string>>& rivals);

/// Chance by the spread over blocks that losses `less` exceed `more`: of rows in order.
double borne_out(const std::vector<double>& less, const std::vector<double>& more, double samples);

/// Huber's losses of the rows that judge, log after log, times what the fit's changes of the nominal cost.
std::vector<double> judging_losses(const ServoProblemOfJoint& p, const KnobFit& fit, double width,
                                   double samples);

/// Joints' effects of one name together; shares by the order-free average over subsets of a joint's effects.
/// `before`: n [rad rms], the nominal model's motion error. Shares below the least are left out.
std::vector<FoundEffect> found_servo_effects(const Robot& nominal, const std::vector<ServoAnswer>& answers,
                                             const ServoPayload& payload, const Eigen::VectorXd& before,
                                             const ServoCriteria& criteria);

}  // namespace dynid::detail
