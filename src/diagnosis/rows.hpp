// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/diagnosis/gap_motion.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid::detail {

constexpr double speed_band = 100.0;  ///< [Hz] of the velocity that friction is computed from

/// Columns of an effect in the rows of a GapRows: of each channel, rows x coefficients.
struct RowBlock {
  std::vector<int> channels;
  std::vector<Eigen::MatrixXd> values;
  Eigen::VectorXd nominal{};  ///< what the coefficients add to, in Hypothesis::possible(); empty: anything is
  Eigen::Index directions = 0;  ///< of the coefficients, that the rows show: a body of one joint has not ten
  Eigen::Index size() const { return values.empty() ? 0 : values.front().cols(); }
  const Eigen::MatrixXd* find(int channel) const {
    for (std::size_t k = 0; k < channels.size(); ++k)
      if (channels[k] == channel) return &values[k];
    return nullptr;
  }
};

/// Rows that follow one another in one part of a GapRows.
struct RowWindow {
  Eigen::Index first, count;
};

/// Logs as rows of the gap: measured minus nominal torque, and every column that may explain it, through one
/// zero-phase filter and decimated to 2.5 times its cut-off (GAP: one filter for all).
class GapRows {
 public:
  /// Takes the logs' segments. The effects of the nominal model are part of its torque.
  GapRows(const Robot& nominal, std::vector<PreparedLog>& logs);
  /// Windows of all rows of logs, each a motion of its own: effects are then computed there alone.
  GapRows(const GapRows& whole, const std::vector<RowWindow>& windows);
  /// The rows of other's where `keep` is true, in parts without holes.
  GapRows(const GapRows& other, const std::vector<bool>& keep);

  int joints() const { return static_cast<int>(y.cols()); }
  Eigen::Index size() const { return y.rows(); }
  RowBlock block(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const;
  /// Shape parameters of a unit of an effect, with the ranges that the motion asks for.
  std::vector<ShapeParameter> shape(const Hypothesis& h, int unit) const;
  /// The same rows with channels that are late by `lateness` (n) [s]: all that effects add is, but for what
  /// an effect that makes them late adds itself.
  GapRows late(const Eigen::VectorXd& lateness) const;
  /// The same rows without those in which a joint sticks, joint by joint: its gap and all columns are 0
  /// there. Within its friction the torque of a joint at rest is anything. `times`: a joint sticks where its
  /// speed stays below so many times what its sensor resolves; for a row or two, where those of all joints do
  /// (one alone may turn round).
  GapRows moving(double times) const;
  const Eigen::VectorXd& lateness() const { return lateness_; }
  /// The same rows, effects being computed from a nominal model whose links are off by `parts` (10 n) of what
  /// their parameters are measured against; the gap stays what it is.
  GapRows with_links_off(const Eigen::VectorXd& parts) const;
  /// Any signals over the motions' samples (one matrix a motion), filtered and decimated alike.
  Eigen::MatrixXd filtered(const std::vector<Eigen::MatrixXd>& signals) const;
  const std::vector<GapMotion>& motions() const { return *motions_; }
  double period() const;           ///< [s] between rows
  double start(int of_log) const;  ///< [s] first stamp of a log (from 0)
  /// [s] of row i, as its log is stamped.
  double stamp(Eigen::Index i) const { return start(log[static_cast<std::size_t>(i)]) + t[i]; }

  Eigen::MatrixXd y;                 ///< rows x n [N m]: the gap
  Eigen::MatrixXd q, dq, ddq, load;  ///< rows x n, filtered alike; load: the rigid body's torque
  std::vector<JointRange> range;     ///< n
  Eigen::VectorXd t;                 ///< [s] since its log's start
  std::vector<int> log;              ///< of each row
  std::vector<Eigen::Index> parts;   ///< first row of each stretch, and, last, the number of rows
  /// Of each joint: what a nominal model off by 1 in every parameter, relatively, adds, reduced to its main
  /// directions.
  std::vector<Eigen::MatrixXd> nuisance;
  /// Of each joint: what torque stamps add that are late by what stamps usually are: data, not an effect.
  Eigen::MatrixXd timing;
  Eigen::VectorXd active;  ///< n: rows that say something about the joint
  /// Of each joint [N m]: standard deviation in the band of white noise as strong as above the band.
  Eigen::VectorXd white_floor;
  /// Of each joint [N m]: what coloured noise is measured against: white_floor, until allow_for_colour().
  Eigen::VectorXd coloured_floor;
  /// Makes coloured_floor at least `part` of the white noise of the logs' own samples: of coloured noise,
  /// which may well be as strong, the filter takes little, however fast the log.
  void allow_for_colour(const std::vector<Log>& logs, double part);

 private:
  struct Stretch {
    DecimatingFilter filter;
    Eigen::Index edge;  // samples at either end without rows
    Eigen::Index first, count;
    int log;
  };
  using Motions = std::vector<GapMotion>;
  using Stretches = std::vector<Stretch>;
  void add(Motions& motions, Stretches& stretches, GapMotion motion, const DecimatingFilter& filter,
           Eigen::Index edge, int of_log);
  void fill(Motions motions, Stretches stretches);
  std::size_t stretch_of(Eigen::Index row) const;
  /// x over the samples of stretch s, filtered into its rows of `out`.
  void filter_stretch(std::size_t s, const Eigen::MatrixXd& x, Eigen::MatrixXd& out) const;
  /// An effect's columns over the samples of stretch s, each channel with its lateness.
  ColumnBlock columns_of(const Hypothesis& h, int unit, const Eigen::VectorXd& shape, std::size_t s) const;
  std::shared_ptr<const std::vector<GapMotion>> motions_;
  std::shared_ptr<const std::vector<Stretch>> stretches_;
  std::vector<Eigen::Index> kept_;  // empty: all
  Eigen::MatrixXd moves_;           // rows x n, 0 or 1; empty: all move
  Eigen::VectorXd lateness_;        // of each channel; empty: none
  std::vector<bool> used_;          // of each stretch: it has rows that are kept; the others are not computed
  void make_nuisance();
  /// Of each joint: its `count` rows from output `first` of stretch s on, and their columns, every `stride`.
  std::vector<Eigen::MatrixXd> nuisance_columns(std::size_t s, Eigen::Index first, Eigen::Index count,
                                                Eigen::Index stride) const;
  void find_ranges();
  void find_white_floor();
};

}  // namespace dynid::detail
