// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/model/uncertainty.hpp"

namespace dynid {

struct ContactTestOptions {
  double false_alarms_per_hour = 1.0;
  /// Part of the threshold below which the statistic must fall for a contact to end.
  double release = 0.36;
  double contact_size = 0.05;  ///< [m] how far from the link's contact_point a push may act
};

/// What the test says of a cycle. n values each, base to tip.
template <int N = Eigen::Dynamic>
struct Contact {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  bool detected = false;
  double statistic = 0.0;  ///< z^T C^-1 z, see ContactTest; 0 before the filters are filled
  double evidence = 0.0;   ///< the statistic over its threshold: above 1 is a contact
  int link = -1;           ///< that is pushed, from 0; -1: nothing is
  Vector residual;         ///< [N m] of the test's window, an interval of sticking friction taken off
  Vector variance;         ///< [(N m)^2] of it
  /// On the link's contact_point; force [N] and moment [N m] about the origin of the wrench's frame, axes of
  /// the base, with their covariance; zero while nothing is detected.
  Vector6 wrench = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< [m] the contact_point in the base frame
};

/// A likelihood-ratio test for contact, set by false alarms an hour.
///
/// The external torque between two samples is low-passed (Uncertainty::window). Divided by the sigma that the
/// model has learnt for the state, it is z, with the correlation C; the statistic z^T C^-1 z is twice the log
/// likelihood ratio of the most likely torque on the joints against none. Its threshold follows from the tail
/// that was learnt on residuals without contact, not from the normal distribution: model errors are neither
/// white nor normal.
///
/// While there is contact, a force at the contact_point of each link is fitted to the residual, drawn towards
/// the size that makes such a statistic there, and the link is the one whose marginal likelihood, averaged
/// over 0.2 s, is largest: the Jacobian's pattern decides, a joint beyond the pushed link speaks against it.
///
/// The constructor and make_tuning() throw and allocate; nothing else does.
template <int N = Eigen::Dynamic>
class ContactTest {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// All that can be exchanged while the loop runs.
  struct Tuning {
    std::vector<JointUncertainty> joints;
    Eigen::Matrix<double, N, N> whitening;  ///< lower triangular W, W^T W = C^-1
    double window = 0.0, threshold = 0.0;
    double settling = 0.0;  ///< [s] before which there is no statistic
    ContactTestOptions options;
  };
  static Tuning make_tuning(const Uncertainty& uncertainty, int n, const ContactTestOptions& options) {
    validate(uncertainty, n);
    const auto positive = [](double x, const char* what) {
      if (!(x > 0.0) || !std::isfinite(x)) throw Error(std::string(what) + ": must be positive");
    };
    positive(options.false_alarms_per_hour, "false_alarms_per_hour");
    if (!(options.release > 0.0 && options.release <= 1.0))
      throw Error("release of a contact: must be in (0, 1]");
    if (!(options.contact_size >= 0.0)) throw Error("contact_size: must not be negative");
    Tuning tuning;
    tuning.joints = uncertainty.joints;
    const Eigen::LLT<Eigen::MatrixXd> factor(uncertainty.correlation);
    tuning.whitening = factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n));
    tuning.window = uncertainty.window;
    tuning.threshold = uncertainty.tail.threshold(options.false_alarms_per_hour);
    tuning.settling = 10.0 / std::min(uncertainty.window, uncertainty.motion_bandwidth);
    tuning.options = options;
    return tuning;
  }

  explicit ContactTest(int n)
      : score_(Vector::Zero(n)),
        rest_(score_),
        r_(score_),
        z_(score_),
        white_(score_),
        deviation_(score_),
        levers_(3, n) {
    contact_.residual = contact_.variance = score_;
    if constexpr (N == Eigen::Dynamic) {
      poses_.resize(static_cast<std::size_t>(n) + 1);
      points_.resize(static_cast<std::size_t>(n));
    }
  }

  /// Forgets the past.
  void reset() noexcept {
    r_.setZero(), rest_.setZero();
    contact_.residual.setZero();
    contact_.statistic = contact_.evidence = 0.0;
    settled_ = 0.0;
    release();
  }

  /// dt [s] > 0 since the sample before; external: torque of the environment in between, unfiltered [N m];
  /// dq [rad/s], tau of the model [N m], ddq [rad/s^2]: n. Says whether there is contact. None before the
  /// filters are filled.
  bool update(double dt, const Vector& external, const Vector& dq, const Vector& tau, const Vector& ddq,
              const Tuning& tuning) noexcept {
    const int n = static_cast<int>(external.size());
    if (const double x = tuning.window * dt; x != step_) step_ = x, share_ = -std::expm1(-x);
    for (int i = 0; i < n; ++i) {
      const JointUncertainty& u = tuning.joints[static_cast<std::size_t>(i)];
      r_[i] += share_ * (external[i] - r_[i]);
      // At rest for a while, a joint sticks; noise of the velocity does not end that at once.
      const bool still = std::abs(dq[i]) < rests * u.stiction_speed;
      rest_[i] = std::clamp(rest_[i] + (still ? dt : -4.0 * dt), 0.0, 2.0 * sticks);
      const double interval = rest_[i] > sticks ? u.sticking : 0.0;
      contact_.residual[i] = r_[i] - std::clamp(r_[i], -interval, interval);
      contact_.variance[i] = u.variance(dq[i], tau[i], ddq[i]);
      z_[i] = contact_.residual[i] / std::sqrt(contact_.variance[i]);
    }
    settled_ += dt;
    contact_.statistic = 0.0;
    if (settled_ > tuning.settling)
      for (int i = 0; i < n; ++i) {
        double white = 0.0;
        for (int j = 0; j <= i; ++j) white += tuning.whitening(i, j) * z_[j];
        contact_.statistic += white * white;
      }
    contact_.evidence = contact_.statistic / tuning.threshold;
    const bool was = contact_.detected;
    contact_.detected = contact_.evidence > (was ? tuning.options.release : 1.0);
    if (was && !contact_.detected) release();
    return contact_.detected;
  }

  /// While there is contact, after update(): which link, and the wrench. q [rad or m]: n. jacobian: 6 x n of
  /// the wrench's frame, rows 3-5 times `length` [m]; origin: of that frame, in the last link's frame [m].
  template <class Jacobian>
  void locate(double dt, const Model<N>& model, Workspace<N>& ws, const Vector& q, const Jacobian& jacobian,
              double length, const Eigen::Vector3d& origin, const Tuning& tuning) noexcept {
    const int n = model.size();
    forward_kinematics(model, ws, q, poses_);
    const Eigen::Vector3d centre = poses_[static_cast<std::size_t>(n) - 1] * origin;
    located_ = contact_.link < 0 ? dt : std::min(located_ + dt, memory);
    const double average = dt / located_;
    // Residual and Jacobian whitened, so that what two joints stray by together is no push.
    for (int i = 0; i < n; ++i) {
      white_[i] = 0.0;
      for (int j = 0; j <= i; ++j) white_[i] += tuning.whitening(i, j) * z_[j];
      deviation_[i] = std::sqrt(contact_.variance[i]);
    }
    const double observed = std::max(contact_.statistic, tuning.threshold);
    Eigen::Matrix3d best_covariance = Eigen::Matrix3d::Zero();
    Eigen::Vector3d best_force = Eigen::Vector3d::Zero(), best_arm = best_force;
    double largest = -1e300;
    for (int k = 0; k < n; ++k) {
      points_[static_cast<std::size_t>(k)] =
          poses_[static_cast<std::size_t>(k)] * tuning.joints[static_cast<std::size_t>(k)].contact_point;
      const Eigen::Vector3d arm = points_[static_cast<std::size_t>(k)] - centre;
      for (int i = 0; i <= k; ++i) {
        const Eigen::Vector3d turn = jacobian.col(i).template tail<3>() / length;
        levers_.col(i) = (jacobian.col(i).template head<3>() + turn.cross(arm)) / deviation_[i];
      }
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (int i = 0; i < n; ++i) {
        Eigen::Vector3d j = Eigen::Vector3d::Zero();
        for (int c = 0; c <= std::min(i, k); ++c) j += tuning.whitening(i, c) * levers_.col(c);
        A.noalias() += j * j.transpose();
        b += white_[i] * j;
      }
      // Forces of this size make a statistic as observed, whatever their direction.
      const double prior = A.trace() > 0.0 ? A.trace() / observed : 1.0;
      A.diagonal().array() += prior;
      const Eigen::Matrix3d C = A.inverse();
      const Eigen::Vector3d force = C * b;
      const double evidence =
          0.5 * b.dot(force) + 0.5 * std::log(std::max(C.determinant() * prior * prior * prior, 1e-300));
      score_[k] += average * (evidence - score_[k]);
      if (score_[k] > largest) {
        largest = score_[k];
        contact_.link = k;
        best_force = force, best_covariance = C, best_arm = arm;
      }
    }
    contact_.point = points_[static_cast<std::size_t>(contact_.link)];
    // The moment is that of the force at the point, which may be a little off.
    Eigen::Matrix3d cross, force_cross;
    cross << 0, -best_arm.z(), best_arm.y(), best_arm.z(), 0, -best_arm.x(), -best_arm.y(), best_arm.x(), 0;
    force_cross << 0, -best_force.z(), best_force.y(), best_force.z(), 0, -best_force.x(), -best_force.y(),
        best_force.x(), 0;
    const double size = tuning.options.contact_size;
    contact_.wrench << best_force, best_arm.cross(best_force);
    contact_.covariance.template topLeftCorner<3, 3>() = best_covariance;
    contact_.covariance.template bottomLeftCorner<3, 3>().noalias() = cross * best_covariance;
    contact_.covariance.template topRightCorner<3, 3>() =
        contact_.covariance.template bottomLeftCorner<3, 3>().transpose();
    contact_.covariance.template bottomRightCorner<3, 3>().noalias() =
        cross * best_covariance * cross.transpose() + size * size * force_cross * force_cross.transpose();
  }

  const Contact<N>& contact() const noexcept { return contact_; }

 private:
  static constexpr double sticks = 0.05;  // [s] of rest, then a joint sticks
  static constexpr double rests = 0.1;    // of its stiction speed
  static constexpr double memory = 0.2;   // [s] that the links are compared over

  void release() noexcept {
    contact_.detected = false;
    contact_.link = -1;
    contact_.wrench.setZero(), contact_.covariance.setZero(), contact_.point.setZero();
    score_.setZero();
    located_ = 0.0;
  }

  template <class T, int More>
  using Some =
      std::conditional_t<N == Eigen::Dynamic, std::vector<T>,
                         std::array<T, N == Eigen::Dynamic ? 1 : static_cast<std::size_t>(N + More)>>;

  Vector score_, rest_, r_, z_, white_, deviation_;
  Eigen::Matrix<double, 3, N> levers_;
  Some<Eigen::Isometry3d, 1> poses_;
  Some<Eigen::Vector3d, 0> points_;
  Contact<N> contact_;
  double step_ = 0.0, share_ = 0.0;       // of the low-pass
  double settled_ = 0.0, located_ = 0.0;  // [s]
};

}  // namespace dynid
