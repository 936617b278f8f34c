// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "servo_data.hpp"

namespace dynid::detail {

using Parameters = std::vector<ServoParameter>;

struct ServoProblem {
  std::vector<const ServoSeries*> series;
  int substeps = 4;
  int longest_delay = 10;  ///< [sampling intervals]
  int earliest_delay = 0;  ///< at most zero: below it, a motion would precede its command
};

/// Bounds and scale of a parameter in the search.
struct ServoBounds {
  bool logarithmic = false;  ///< searched as its logarithm: it is positive
  double low = 0.0, high = 0.0;
};
ServoBounds servo_bounds(ServoParameter p, const ServoProblem& problem);

/// Open-loop motion at the stamps, from the first position at rest.
Eigen::VectorXd simulate_servo(const ServoJoint& joint, const ServoSeries& series, int substeps);

/// Mean absolute error of the open-loop motion [rad] of each series.
Eigen::VectorXd servo_errors(const ServoJoint& joint, const ServoProblem& problem);

struct ServoSolution {
  ServoJoint joint;
  double cost = 0.0;   ///< Huber's loss a sample [rad^2]
  double width = 0.0;  ///< of Huber's loss [rad]
  int iterations = 0;
};

/// Levenberg-Marquardt over `free`, from `start`. `width`: of Huber's loss.
ServoSolution fit_servo(const ServoProblem& problem, const ServoJoint& start, const Parameters& free,
                        double width, int iterations);

/// 1.345 robust standard deviations of the residual, at least the encoder's step: Huber's constant.
double huber_width(const ServoProblem& problem, const ServoJoint& joint);

/// Equation error in closed form for each delay of a grid; nothing where the motion is too little.
std::optional<ServoJoint> equation_error(const ServoProblem& problem);

/// Scores in the coordinates of the search.
struct ServoInformation {
  Parameters free;
  std::vector<bool> visible;   ///< the motion depends on it at all
  Eigen::MatrixXd covariance;  ///< of the coordinates (logarithms where logarithmic)
  Eigen::MatrixXd hessian;     ///< of half the loss
  double degrees = 0.0;        ///< of freedom
};
ServoInformation servo_information(const ServoProblem& problem, const ServoSolution& solution,
                                   const Parameters& free);

}  // namespace dynid::detail
