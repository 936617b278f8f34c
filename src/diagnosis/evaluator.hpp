// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <vector>

#include "dynid/diagnosis/criteria.hpp"
#include "gap_model.hpp"

namespace dynid::detail {

/// What a joint has of a model: its gap less what the model's coupled effects and those without coefficients
/// add, and the columns of the effects of its own, which are fitted anew with every candidate.
struct Channel {
  Eigen::VectorXd y;            ///< rows
  Eigen::MatrixXd columns;      ///< rows x p, p may be 0
  double evidence;              ///< of their fit
  std::vector<SeenChannel> by;  ///< by white noise, and by that of their fit
};

/// A model that candidates are tried on top of.
struct Base {
  const GapModel& model;
  std::vector<Channel> channels;  ///< of each joint
  SeenTerms terms;                ///< the model's, by white noise, and by that of its fit
};

Eigen::MatrixXd beside(const Eigen::MatrixXd& left, const Eigen::MatrixXd& right);

/// Columns once made, by effect, unit and shape: every step of a search asks for the same ones again. What is
/// found in it is what would be made anew, so neither its limit nor the order of threads changes a result.
class BlockMemo {
 public:
  std::shared_ptr<const RowBlock> of(const GapRows& rows, const Hypothesis& h, int unit,
                                     const Eigen::VectorXd& shape);

 private:
  using Key = std::tuple<const Hypothesis*, int, std::vector<double>>;
  std::mutex mutex_;
  std::map<Key, std::shared_ptr<const RowBlock>> made_;
  Eigen::Index numbers_ = 0;  // that they hold
};

/// Scores sets of effects on the rows of a gap. Holds references: both are to outlive it.
class Evaluator {
 public:
  Evaluator(const GapRows& of_rows, const Criteria& of_criteria)
      : rows(of_rows), criteria(of_criteria), memo_(std::make_unique<BlockMemo>()) {}

  /// What an effect costs of the score: each coefficient and each shape parameter by Schwarz, the choice of
  /// joints by its number of outcomes, and its prior.
  double cost(const Adopted& effect) const;
  /// What one unit of an effect costs, but for the effect itself.
  double price(const Hypothesis& h, const UnitShape& unit) const;
  /// A set fitted.
  GapModel evaluate(std::vector<Adopted> effects, double kappa) const;
  UnitShape made(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const;
  /// Lets go of the columns that were made.
  void forget() { memo_ = std::make_unique<BlockMemo>(); }
  /// The same effects, shapes and joints over these rows, whichever they were found in.
  std::vector<Adopted> here(std::vector<Adopted> effects) const;

  Base base_of(const GapModel& model) const;
  /// `keep_own`: the joint's own effects stay, to be fitted anew, all but `without` (null: all of them); else
  /// they are taken out.
  Channel channel_of(const GapModel& model, int joint, bool keep_own,
                     const Hypothesis* without = nullptr) const;
  /// Log evidence that a block adds to a joint's own channel, and to all of them.
  double own_gain(const Hypothesis& h, int joint, const RowBlock& block, const Channel& channel,
                  double kappa) const;
  double coupled_gain(const Hypothesis& h, const RowBlock& block, const Base& base) const;

  /// Whether coefficients and shape can be those of such an effect on such a joint, and on these logs.
  bool plausible(const Hypothesis& h, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd& shape) const {
    return h.plausible(robot(), unit, c, shape) && h.reachable(rows.range, unit, c, shape);
  }
  /// And so of every unit of every effect of a model.
  bool plausible(const GapModel& model) const;
  const Robot& robot() const { return rows.motions().front().robot(); }

  const GapRows& rows;
  const Criteria& criteria;

 private:
  std::unique_ptr<BlockMemo> memo_;
};

}  // namespace dynid::detail
