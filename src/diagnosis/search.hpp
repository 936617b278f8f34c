// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
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
  /// The set with one effect after another in exchange for a better one, until none is better.
  GapModel exchanged(GapModel model) const;
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
  /// Of each effect with one coefficient on a joint of its own: the torque that it would have had to have to
  /// be named, on the joint that shows it least.
  std::vector<VisibleSize> smallest_visible(const GapModel& none) const;
  const GapRows& rows() const { return rows_; }

 private:
  struct GridPoint {
    Eigen::VectorXd shape;
    std::shared_ptr<const RowBlock> block;
  };
  using Grid = std::vector<std::vector<GridPoint>>;  // unit, point

  /// What a joint has of a model: its gap less what the model's coupled effects and those without
  /// coefficients add, and the columns of the effects of its own, which are fitted anew with every candidate.
  struct Channel {
    Eigen::VectorXd y;         // rows
    Eigen::MatrixXd columns;   // rows x p, p may be 0
    double evidence;           // of their fit
    std::vector<Whitener> by;  // white noise, and that of their fit
  };
  struct Base {
    const GapModel& model;
    std::vector<Channel> channels;          // of each joint
    std::vector<std::vector<Whitener>> by;  // white noise, and the model's: of each joint
  };
  using Gain = std::function<double(const RowBlock&)>;

  double cost(const Adopted& effect) const;
  /// What one unit of an effect costs of the score, but for the effect itself.
  double price(const Hypothesis& h, const UnitShape& unit) const;
  Base base_of(const GapModel& model) const;
  /// `keep_own`: the joint's own effects stay, to be fitted anew; else they are taken out.
  Channel channel_of(const GapModel& model, int joint, bool keep_own) const;
  /// The best form of one effect beside those of `base`.
  Adopted propose(const Hypothesis& h, const Grid& grid, const Base& base) const;
  Adopted propose_own(const Hypothesis& h, const Grid& grid, const Base& base) const;
  Adopted propose_coupled(const Hypothesis& h, const Grid& grid, const Base& base) const;
  Adopted propose_window(const Hypothesis& h, const Grid& grid, const Base& base) const;
  /// The best point of the grid by `gain`, refined where it gains `worth`.
  UnitShape best_shape(const Hypothesis& h, int unit, const std::vector<GridPoint>& points, const Gain& gain,
                       double worth = -std::numeric_limits<double>::infinity()) const;
  UnitShape refined(const Hypothesis& h, UnitShape unit, const Gain& gain) const;
  /// Shape parameter `s` of a unit between low and high, kept where it gains more than `best`: returns the
  /// gain.
  double improve(const Hypothesis& h, UnitShape& unit, Eigen::Index s, double low, double high,
                 bool logarithmic, double best, const Gain& gain) const;
  double own_gain(const Hypothesis& h, const RowBlock& block, const Channel& channel, double kappa) const;
  double coupled_gain(const Hypothesis& h, const RowBlock& block, const Base& base) const;
  /// Which joint has which of the model's own effects, each joint decided by itself: an effect that came
  /// first may have taken joints of one that came later.
  GapModel reassigned(const GapModel& model) const;
  UnitShape made(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const;

  const GapRows& rows_;
  std::vector<const Hypothesis*> library_;
  std::vector<Grid> grids_;
};

}  // namespace dynid::detail
