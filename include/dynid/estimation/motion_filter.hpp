// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "dynid/base/error.hpp"

namespace dynid {

struct MotionFilterOptions {
  double bandwidth = 100.0;  ///< w [1/s] of the three poles
  /// [s] of the robot's own clock; 0: the stamps are the times of the samples.
  double period = 0.0;
  double position_noise = 1e-5;  ///< [rad or m] of one sample; matters where there is a period
};

/// Velocity and acceleration from measured positions: three poles at -w, no delay while the acceleration is
/// constant. Encoders are quieter than most velocities that a controller reports, which are late, too.
///
/// A robot samples by its own clock, but messages are stamped when they are sent: stamps that jitter by 0.2
/// ms cost 0.2 mrad at 1 rad/s, ten times an encoder's noise. Where the period is known, the time between two
/// samples is the number of periods nearest to what stamp and motion say together. A stamp is good to 0.3
/// periods; it tells the time since the periods counted so far, so that a wrong count is made good by the
/// next. The motion along the present velocity is good to `position_noise`, the velocity to 5 %: one that a
/// wrong count has spoilt would otherwise confirm it for ever.
///
/// The constructor throws Error on a value out of range and, for N = Eigen::Dynamic, allocates; nothing else
/// does.
template <int N = Eigen::Dynamic>
class MotionFilter {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  explicit MotionFilter(int n, const MotionFilterOptions& options = {})
      : x_(Vector::Zero(n)), v_(x_), a_(x_), last_(x_) {
    check(options);
    set_options(options);
  }

  /// Throws Error on a value out of range.
  static void check(const MotionFilterOptions& options) {
    if (!(options.bandwidth > 0.0) || !std::isfinite(options.bandwidth))
      throw Error("bandwidth of the motion filter: must be positive [1/s]");
    if (!(options.period >= 0.0) || !std::isfinite(options.period))
      throw Error("period of the motion filter: must not be negative [s]");
    if (!(options.position_noise > 0.0) || !std::isfinite(options.position_noise))
      throw Error("position noise of the motion filter: must be positive");
  }
  /// Others, checked; the motion goes on from where it is.
  void set_options(const MotionFilterOptions& options) noexcept {
    options_ = options;
    tune(options.period > 0.0 ? options.period : 1e-3);
  }

  /// Starts at q [rad or m] with dq [rad/s or m/s], n each.
  void start(const Vector& q, const Vector& dq) noexcept {
    x_ = last_ = q;
    v_ = dq;
    a_.setZero();
    late_ = usual_ = 0.0;
  }

  /// Time since the sample before [s], a multiple of the period where there is one: 0 says that q is that of
  /// the sample before. dt > 0 [s]: by the stamps; q: n, measured.
  double elapsed(double dt, const Vector& q) const noexcept {
    const double T = options_.period;
    if (!(T > 0.0)) return dt;
    double along = 0.0, speed = 0.0;
    for (Eigen::Index i = 0; i < v_.size(); ++i) {
      const double v = v_[i] + 0.5 * dt * a_[i];  // in the middle
      along += v * (q[i] - last_[i]);
      speed += v * v;
    }
    const double stamped = dt + late_ - usual_;  // since a stamp as late as usual
    // Of the motion along v: two samples' noise, and the velocity's error.
    const double noise = options_.position_noise, error = velocity_error * along;
    const double motion = 1.0 / (2.0 * noise * noise + error * error / std::fmax(speed, tiny));
    const double stamp = 1.0 / (0.09 * T * T);
    const double likely = (along * motion + stamped * stamp) / (speed * motion + stamp);
    return T * std::round(std::fmax(likely / T, 0.0));
  }

  /// The next sample, dt > 0 [s] later; q: n.
  void update(double dt, const Vector& q) noexcept { update(dt, q, dt); }
  /// The same, dt of elapsed() later, `stamped` [s] by the stamps.
  void update(double dt, const Vector& q, double stamped) noexcept {
    if (dt != step_) tune(dt);
    late_ += stamped - dt;
    usual_ += std::fmin(dt / lateness_memory, 1.0) * (late_ - usual_);
    for (Eigen::Index i = 0; i < v_.size(); ++i) {
      const double a = a_[i], v = v_[i] + dt * a, x = x_[i] + dt * (v_[i] + 0.5 * dt * a);
      const double e = q[i] - x;
      x_[i] = x + gain_x_ * e;
      v_[i] = v + gain_v_ * e;
      a_[i] = a + gain_a_ * e;
    }
    last_ = q;
  }

  const Vector& position() const noexcept { return x_; }      ///< n [rad or m]
  const Vector& velocity() const noexcept { return v_; }      ///< n [rad/s or m/s]
  const Vector& acceleration() const noexcept { return a_; }  ///< n [rad/s^2 or m/s^2]
  const MotionFilterOptions& options() const noexcept { return options_; }

 private:
  static constexpr double velocity_error = 0.05;
  static constexpr double lateness_memory = 0.5;  // [s]: clocks drift apart, a network changes its delay
  static constexpr double tiny = 1e-300;

  // Gains that put all three poles of the sampled filter at exp(-w dt).
  void tune(double dt) noexcept {
    const double b = std::exp(-options_.bandwidth * dt), c = 1.0 - b;
    step_ = dt;
    gain_x_ = 1.0 - b * b * b;
    gain_v_ = 1.5 * c * c * (1.0 + b) / dt;
    gain_a_ = c * c * c / (dt * dt);
  }

  MotionFilterOptions options_;
  Vector x_, v_, a_, last_;
  double late_ = 0.0, usual_ = 0.0;  // [s] of the stamps behind the periods counted since the start
  double step_ = 0.0, gain_x_ = 0.0, gain_v_ = 0.0, gain_a_ = 0.0;
};

}  // namespace dynid
