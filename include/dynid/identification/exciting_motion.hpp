// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// How a finite Fourier series becomes a motion that starts and ends at rest.
enum class MotionKind {
  fourier,  ///< the series itself, its coefficients such that dq = ddq = 0 at both ends
  ramped,   ///< any series, its time started and stopped by a polynomial: exactly periodic in between
};

/// What a motion has besides its coefficients: base frequency and the run of time.
struct MotionShape {
  MotionKind kind = MotionKind::fourier;
  int harmonics = 5;     ///< L >= 1
  double omega = 0.3;    ///< [rad/s] base frequency w of the series
  double duration = 21;  ///< [s] of the motion, from rest to rest
  double ramp = 1.0;     ///< [s] of the start and of the end of a ramped motion; not used by the other kind

  /// Throws Error naming the quantity: at least one harmonic, positive times, ramps that fit in.
  void validate() const;
};

/// The series' terms at N instants, with three derivatives in time: N x 2 L each, columns
/// sin(l w s)/(l w), l = 1..L, then -cos(l w s)/(l w), where s is the series' time.
struct MotionBasis {
  Eigen::MatrixXd q, dq, ddq, jerk;
  /// `t` [s], 0..duration. Allocates.
  MotionBasis(const MotionShape& shape, const Eigen::VectorXd& t);
};

/// The orthogonal projection (2 L x 2 L) onto coefficients whose motion has dq = ddq = 0 at both ends; the
/// identity for a ramped motion, which rests there whatever its coefficients. Where the duration is a whole
/// number of periods the two ends are one condition.
Eigen::MatrixXd rest_projection(const MotionShape& shape);

/// Exciting motion (supplementary material of the letter, Section II), joint by joint
///   q_j(s) = sum_l a_lj/(l w) sin(l w s) - b_lj/(l w) cos(l w s) + q0_j, l = 1..L.
/// s is the time t itself, or, for a ramped motion, s(t) = integral of a speed that climbs from 0 to 1 by the
/// smooth step 10 u^3 - 15 u^4 + 6 u^5 over the first `ramp` seconds and falls so over the last: the path is
/// the series' own, its middle is the series in real time, and the jerk stays continuous.
class ExcitingMotion {
 public:
  ExcitingMotion() = default;
  /// `coefficients`: 2 L x n, rows a_1..a_L, b_1..b_L [rad/s]; `offset` q0: n [rad]. Throws Error on sizes
  /// that do not match. Rest at the ends is the caller's to ask for, see rest_projection().
  ExcitingMotion(const MotionShape& shape, Eigen::MatrixXd coefficients, Eigen::VectorXd offset);

  const MotionShape& shape() const noexcept { return shape_; }
  const Eigen::MatrixXd& coefficients() const noexcept { return coefficients_; }  ///< 2 L x n [rad/s]
  const Eigen::VectorXd& offset() const noexcept { return offset_; }              ///< q0: n [rad]
  int joints() const noexcept { return static_cast<int>(offset_.size()); }

  /// At N instants `t` [s], 0..duration: q [rad], dq, ddq, as a trajectory, and the jerk [rad/s^3] (N x n)
  /// where it is asked for. Allocates.
  Trajectory at(const Eigen::VectorXd& t, Eigen::MatrixXd* jerk = nullptr) const;
  /// At `rate` [Hz] or, where the duration is not a whole number of samples, at the next higher rate that
  /// makes it so; velocity and acceleration of the first and last sample are exactly zero where they are so
  /// but for rounding. Throws Error unless rate > 0.
  Trajectory sampled(double rate) const;

 private:
  MotionShape shape_;
  Eigen::MatrixXd coefficients_;
  Eigen::VectorXd offset_;
};

}  // namespace dynid
