// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// What a position controller is to follow: a position held, or a motion from there and then its end. The
/// step from the position held to a motion's first sample goes smoothly over the first `blending` seconds of
/// the motion, and a stop along the motion's own path over `stopping` seconds. Nothing but the constructor
/// allocates, and nothing throws.
class PlantReference {
 public:
  static constexpr double blending = 0.5;  ///< [s]
  static constexpr double stopping = 0.3;  ///< [s]

  explicit PlantReference(const Eigen::VectorXd& held);

  /// Takes `motion` (n joints, time from 0) by exchanging it for the last one, to begin at `start` [s];
  /// until then the position is held. To be called at rest.
  void begin(Trajectory& motion, double start) noexcept;
  /// Comes to rest along the path from instant `t` [s] on; forgets a motion that has not begun.
  void stop(double t) noexcept;

  /// The reference of instant `t` [s], not earlier than the last one: n each.
  void at(double t, Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& ddq) noexcept;

  /// A motion is under way or waits for its start.
  bool moving() const noexcept { return moving_; }
  const Eigen::VectorXd& held() const noexcept { return held_; }  ///< n: where it rests, or last rested

 private:
  Trajectory motion_;
  Eigen::VectorXd held_, offset_;
  double start_ = 0.0, end_ = 0.0, stop_ = 0.0;
  bool moving_ = false, stopped_ = false;
};

}  // namespace dynid
