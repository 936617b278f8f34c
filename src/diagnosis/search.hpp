// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "fit.hpp"

namespace dynid::detail {

/// Scores are log probabilities times this, see docs/diagnosis.md.
constexpr double score_temperature = 4.0;

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
  double kappa = 0.0;
  Fit fit;
  double score = 0.0;  ///< log evidence, less what the effects' parameters and choices cost
};

/// Finds effects in the rows of a gap: steps 5 and 7 of the method.
class Search {
 public:
  /// `library`: what may be found. Columns of every grid point are computed here, on all cores.
  Search(const GapRows& rows, std::vector<const Hypothesis*> library);

  /// The best set of up to `most` effects, by forward steps with joint refits, exchanges and a backward
  /// check, for a nominal model whose parameters are off by `kappa`, relatively.
  GapModel best(double kappa, int most) const;
  /// The gap with no effect.
  GapModel none(double kappa) const { return evaluate({}, kappa); }
  /// A set refitted.
  GapModel evaluate(std::vector<Adopted> effects, double kappa) const;
  /// The best form of every effect on top of a model (which may be none()), best first: each refitted jointly
  /// with it.
  std::vector<GapModel> alternatives(const GapModel& base, std::size_t joint_refits) const;
  /// p-value of a gap (rows x n) against surrogates of it: the largest part that any one effect explains,
  /// each standardised by what it explains of the surrogates (Westfall and Young 1993).
  double p_value(const Eigen::MatrixXd& gap, const std::vector<Eigen::MatrixXd>& surrogates) const;
  const GapRows& rows() const { return rows_; }

 private:
  struct GridPoint {
    Eigen::VectorXd shape;
    std::shared_ptr<const RowBlock> block;
  };
  using Grid = std::vector<std::vector<GridPoint>>;  // unit, point

  double cost(const Adopted& effect) const;
  /// The best form of one effect in what `base` leaves.
  Adopted propose(const Hypothesis& h, const Grid& grid, const GapModel& base) const;
  Adopted propose_own(const Hypothesis& h, const Grid& grid, const GapModel& base) const;
  Adopted propose_coupled(const Hypothesis& h, const Grid& grid, const GapModel& base) const;
  Adopted propose_window(const Hypothesis& h, const Grid& grid, const GapModel& base) const;
  UnitShape refined(const Hypothesis& h, UnitShape unit, const GapModel& base) const;
  double unit_gain(const Hypothesis& h, const RowBlock& block, const GapModel& base) const;
  UnitShape made(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const;

  const GapRows& rows_;
  std::vector<const Hypothesis*> library_;
  std::vector<Grid> grids_;
};

}  // namespace dynid::detail
