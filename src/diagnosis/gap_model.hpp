// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "fit.hpp"

namespace dynid::detail {

/// One unit of an effect, at one shape.
struct UnitShape {
  int unit = 0;
  Eigen::VectorXd shape;
  std::shared_ptr<const RowBlock> block;
};

/// An effect with the joints (or link, pair, window) that it has.
struct Adopted {
  const Hypothesis* h = nullptr;
  std::vector<UnitShape> units;
  double gain = 0.0;  ///< of score, when it was proposed
  Eigen::Index coefficients() const;
};

/// Effects that together explain the gap.
struct GapModel {
  std::vector<Adopted> effects;
  double kappa = 0.0;  ///< relative error of the nominal parameters that was allowed for
  Fit fit;
  double score = 0.0;  ///< log evidence, less what the effects' parameters and choices cost
};

/// The effect acts in the torque of its own joint alone, where this is its columns.
bool own_channel(const Hypothesis& h, const RowBlock& block);
std::vector<Term> terms_of(const std::vector<Adopted>& effects);
bool has_window(const GapModel& model);
bool has_once(const GapModel& model);
/// [s] by which the effects of a model make the channels late: n.
Eigen::VectorXd lateness(const GapModel& model, int joints);
/// The set without one.
std::vector<Adopted> without(const std::vector<Adopted>& effects, std::size_t which);

/// The same effects, shapes and joints over other rows.
std::vector<Adopted> carried(const GapRows& rows, const std::vector<Adopted>& effects);
Fit fit_of(const GapRows& rows, const std::vector<Adopted>& effects, double kappa);
/// What one effect of a model adds in the rows that the model was fitted to.
Eigen::MatrixXd own_contribution(const GapModel& model, std::size_t which);
/// What the effects of a model add in any rows, with coefficients `theta`: all of them, or the one at `only`.
Eigen::MatrixXd contribution(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& theta,
                             std::ptrdiff_t only = -1);

}  // namespace dynid::detail
