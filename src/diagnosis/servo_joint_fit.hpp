// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "identification/servo_data.hpp"
#include "servo_knobs.hpp"

namespace dynid::detail {

/// One joint's part of a log, and which of its rows count.
struct ServoRows {
  ServoSeries series;
  std::vector<char> fit;   ///< N: the row chooses and fits
  std::vector<char> half;  ///< N: 0 or 1, of two halves that are left out in turn
  Eigen::Index first = 0;  ///< of the log's rows
};

/// One joint: its rows, its model, its sizes.
struct ServoProblemOfJoint {
  std::vector<ServoRows> rows;
  Knobs nominal{};
  KnobScale scale;
  double tolerance = 0.02;   ///< relative, of the nominal parameters
  double temperature = 1.0;  ///< ServoCriteria::temperature
  double floor = 0.0;        ///< standard deviation of what no model explains [rad]
  int substeps = 1;
};

/// Which rows are looked at.
enum class RowSet { fit, first_half, second_half };

struct KnobFit {
  Knobs x{};
  double loss = 0.0;     ///< Huber's, mean over the rows [rad^2]
  double penalty = 0.0;  ///< of the nominal parameters' changes, half a sum of squares
  double width = 0.0;    ///< of Huber's loss [rad]
};

/// Standard deviation of a nominal knob: 0 of one that may not be off.
double nominal_deviation(const ServoProblemOfJoint& p, Knob k);

/// Motion at the stamps of `rows` [rad].
Eigen::VectorXd servo_motion(const ServoProblemOfJoint& p, const Knobs& x, const ServoRows& rows);
/// Mean loss of a motion over rows that are (or, where `others`, are not) of the set.
double servo_loss(const ServoProblemOfJoint& p, const Knobs& x, RowSet set, double width);

/// Levenberg-Marquardt from `start`: `free` without prior, the other nominal parameters that are not zero
/// within the tolerance. `samples`: independent ones, for the weight of the prior.
KnobFit fit_knobs(const ServoProblemOfJoint& p, const Knobs& start, const std::vector<Knob>& free, RowSet set,
                  double width, double samples, int iterations);
/// From the best of several starts.
KnobFit fit_from(const ServoProblemOfJoint& p, const std::vector<Knobs>& starts,
                 const std::vector<Knob>& free, RowSet set, double width, double samples, int iterations);

/// Huber's constant times the robust spread of the residual, at least the floor's.
double servo_width(const ServoProblemOfJoint& p, const Knobs& x);
/// Rows, divided by how long they stay correlated.
double independent_samples(const Eigen::VectorXd& r);
/// Rows that count, divided by how long the residual stays correlated, and by the temperature.
double independent_samples(const ServoProblemOfJoint& p, const Knobs& x);
/// Log evidence of a fit but for the price of what it frees.
double log_evidence(const ServoProblemOfJoint& p, const KnobFit& fit, double samples);

/// Covariance of the knobs `free` (columns in that order), the other nominal ones within the tolerance.
Eigen::MatrixXd knob_covariance(const ServoProblemOfJoint& p, const KnobFit& fit,
                                const std::vector<Knob>& free, double samples);
/// [rad rms] by which the motion changes when every nominal parameter is off by the tolerance.
double tolerated_motion(const ServoProblemOfJoint& p);

}  // namespace dynid::detail
