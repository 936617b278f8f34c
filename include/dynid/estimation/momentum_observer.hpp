// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

enum class ObserverOrder {
  first,   ///< r' = K (tau_ext - r)
  second,  ///< r'' = w^2 (tau_ext - r) - 2 zeta w r', w = 2 zeta K: the same mean delay 1/K, steeper beyond
  /// The first order's with a gain that follows the noise: the Kalman filter of a tau_ext that drifts and is
  /// measured with the noise of the moment.
  kalman,
};

/// Generalised-momentum observer (De Luca, Albu-Schaeffer, Haddadin, Hirzinger 2006):
///   r = K (p - p(0) - integral of (tau + S^T dq - g - tau_f + r)),   p = M dq.
///
/// r is tau_ext low-passed: the torque that the environment exerts on the joints, positive where it pushes
/// the joint in its positive direction. From one sample to the next tau_ext is taken as constant, and the
/// filter's answer to that is exact whatever dt: time constant 1/K, no stability limit on K dt.
///
/// The constructor throws and, for N = Eigen::Dynamic, allocates; nothing else does.
template <int N = Eigen::Dynamic>
class MomentumObserver {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// gain: K [1/s], one for each joint. damping: zeta of the second-order form, in (0, 1]; 1 has no
  /// overshoot. Throws Error on a value out of range.
  explicit MomentumObserver(const Vector& gain, ObserverOrder order = ObserverOrder::first,
                            double damping = 1.0)
      : gain_(gain),
        p_(gain),
        u_(gain),
        r_(gain),
        slope_(gain),
        external_(gain),
        variance_(gain),
        order_(order),
        damping_(damping) {
    for (Eigen::Index i = 0; i < gain.size(); ++i)
      if (!(gain[i] > 0.0) || !std::isfinite(gain[i]))
        throw Error("observer gain of joint " + std::to_string(i + 1) + ": must be positive [1/s]");
    if (!(damping > 0.0 && damping <= 1.0)) throw Error("observer damping: must be in (0, 1]");
    p_.setZero(), u_.setZero();
    r_.setZero(), slope_.setZero(), external_.setZero(), variance_.setZero();
  }

  /// Another K [1/s], n, positive; r goes on from where it is.
  void set_gain(const Vector& gain) noexcept { gain_ = gain; }

  /// Starts at r = 0 with the momentum p and the known torque u = tau + S^T dq - g - tau_f (n each).
  void start(const Vector& p, const Vector& u) noexcept {
    r_.setZero(), slope_.setZero(), variance_.setZero();
    rebase(p, u);
  }
  /// Another model's p and u for the sample before: r goes on without a jump.
  void rebase(const Vector& p, const Vector& u) noexcept { p_ = p, u_ = u; }

  /// The next sample, dt > 0 [s] later. Returns r [N m]. Of the Kalman form without its noise: the first
  /// order.
  const Vector& update(double dt, const Vector& p, const Vector& u) noexcept {
    const double rate = 1.0 / dt;
    if (order_ != ObserverOrder::second) {
      for (Eigen::Index i = 0; i < gain_.size(); ++i) {
        const double external = external_[i] = (p[i] - p_[i]) * rate - 0.5 * (u[i] + u_[i]);
        r_[i] += (external - r_[i]) * -std::expm1(-gain_[i] * dt);
      }
    } else {
      // With x = r - tau_ext: x'' + 2 zeta w x' + w^2 x = 0, solved in closed form.
      for (Eigen::Index i = 0; i < gain_.size(); ++i) {
        const double external = external_[i] = (p[i] - p_[i]) * rate - 0.5 * (u[i] + u_[i]);
        const double decay = 2.0 * damping_ * damping_ * gain_[i], natural = 2.0 * damping_ * gain_[i];
        const double angle = natural * std::sqrt(1.0 - damping_ * damping_) * dt;
        const double e = std::exp(-decay * dt), cosine = e * std::cos(angle);
        const double sine = e * dt * (angle > 1e-4 ? std::sin(angle) / angle : 1.0 - angle * angle / 6.0);
        const double x = r_[i] - external, v = slope_[i];
        r_[i] = external + cosine * x + sine * (v + decay * x);
        slope_[i] = cosine * v - sine * (natural * natural * x + decay * v);
      }
    }
    p_ = p, u_ = u;
    return r_;
  }

  /// The step of the Kalman form. drift [(N m)^2/s]: by how much the variance of tau_ext grows; noise
  /// [(N m)^2 s]: two-sided density of what tau_ext is measured with; n each, positive. Where both are
  /// constant the gain becomes sqrt(drift / noise) [1/s].
  void update(double dt, const Vector& p, const Vector& u, const Vector& drift,
              const Vector& noise) noexcept {
    eigen_assert(order_ == ObserverOrder::kalman);
    const double rate = 1.0 / dt;
    for (Eigen::Index i = 0; i < gain_.size(); ++i) {
      const double external = external_[i] = (p[i] - p_[i]) * rate - 0.5 * (u[i] + u_[i]);
      const double before = variance_[i] + drift[i] * dt, measured = noise[i] * rate;
      const double share = before / (before + measured);
      r_[i] += share * (external - r_[i]);
      variance_[i] = share * measured;
    }
    p_ = p, u_ = u;
  }

  const Vector& residual() const noexcept { return r_; }  ///< r [N m], n
  /// tau_ext [N m] between the last two samples, not filtered; n.
  const Vector& external() const noexcept { return external_; }
  const Vector& gain() const noexcept { return gain_; }  ///< K [1/s], n
  /// [(N m)^2] of r by the Kalman form, n; 0 in the others.
  const Vector& variance() const noexcept { return variance_; }

 private:
  Vector gain_, p_, u_, r_, slope_, external_, variance_;
  ObserverOrder order_;
  double damping_;
};

}  // namespace dynid
