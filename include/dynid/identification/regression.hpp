// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

/// A prepared log as regression rows: torque and every regressor column through the same zero-phase filter,
/// then one row every 1 / (2.5 cut-off) s, since closer rows carry nothing new; none within a period of the
/// cut-off from the ends of a stretch, where the filter has to invent what came before or after.
class RegressionRows {
 public:
  /// `base` names the columns of the rigid body (and rotor inertia). Runs on all cores; the result does not
  /// depend on how many.
  RegressionRows(const Robot& robot, const BaseParameters& base, const PreparedLog& log);

  Eigen::Index size() const noexcept { return tau_.rows(); }             ///< N rows a joint
  int joints() const noexcept { return static_cast<int>(tau_.cols()); }  ///< n
  const Eigen::VectorXd& t() const noexcept { return t_; }               ///< [s] N
  const Eigen::MatrixXd& tau() const noexcept { return tau_; }           ///< [N m] N x n
  /// Columns of joint j (from 0): N x base.size().
  const Eigen::MatrixXd& rigid(int j) const noexcept { return rigid_[static_cast<std::size_t>(j)]; }
  /// First row of each stretch without gaps, and, last, N.
  const std::vector<Eigen::Index>& parts() const noexcept { return parts_; }
  /// Rows on either side, within two periods of the cut-off, that share data with a row (the kernel holds
  /// less than 1 % beyond).
  Eigen::Index overlap() const noexcept { return overlap_; }

  /// Columns of joint j made of its velocity [rad/s], filtered alike: `row(dq)` has `columns` entries; N x
  /// columns.
  Eigen::MatrixXd velocity_columns(int j, int columns,
                                   const std::function<Eigen::RowVectorXd(double)>& row) const;
  /// Velocity of joint j [rad/s], filtered alike: N.
  Eigen::VectorXd velocity(int j) const;

 private:
  std::vector<Eigen::MatrixXd> rigid_;
  Eigen::MatrixXd tau_;
  Eigen::VectorXd t_;
  std::vector<Eigen::Index> parts_;
  Eigen::Index overlap_ = 0;
  std::vector<DecimatingFilter> filters_;   // one a part
  std::vector<Eigen::Index> first_output_;  // of each part's filter that is a row
  std::vector<Eigen::MatrixXd> dq_;         // one a part, before decimation
};

}  // namespace dynid
