// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
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
/// over the contact (half a second at most) and joined to the link's extent, is largest: the Jacobian's
/// pattern decides, a joint beyond the pushed link speaks against it. Where the pattern leaves a choice, as
/// between a push in the middle of the arm and a far stronger one beside the shoulder, the weaker is
/// likelier: pushes of more than F newtons are taken to be as rare as 1 / F, which prefers no scale of force.
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
    Vector log_extent;      ///< log of the links' sizes: the larger, the likelier it is met
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
    tuning.log_extent.resize(n);
    for (int i = 0; i < n; ++i)
      tuning.log_extent[i] = std::log(uncertainty.joints[static_cast<std::size_t>(i)].extent);
    tuning.options = options;
    return tuning;
  }

  explicit ContactTest(int n)
      : score_(Vector::Zero(n)),
        rest_(score_),
        r_(score_),
        z_(score_),
        white_(score_),
        certainty_(score_),
        levers_(6, n) {
    contact_.residual = contact_.variance = score_;
    if constexpr (N == Eigen::Dynamic) pushes_.resize(static_cast<std::size_t>(n));
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
      certainty_[i] = 1.0 / std::sqrt(contact_.variance[i]);
      z_[i] = certainty_[i] * contact_.residual[i];
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

  /// While there is contact, after update(): which link, and the wrench. ws: as jacobian() left it at the
  /// present q. jacobian: 6 x n of the wrench's frame, rows 3-5 times `length` [m]; origin: of that frame, in
  /// the last link's frame [m].
  template <class Jacobian>
  void locate(double dt, const Model<N>& model, Workspace<N>& ws, const Jacobian& jacobian, double length,
              const Eigen::Vector3d& origin, const Tuning& tuning) noexcept {
    const int n = model.size();
    const Eigen::Vector3d centre = placed_point(model, ws, n - 1, origin);
    const bool first = contact_.link < 0;
    located_ = first ? dt : std::min(located_ + dt, memory);
    turn_ = first || turn_ + 1 >= n ? 0 : turn_ + 1;
    // Residual and Jacobian whitened, so that what two joints stray by together is no push.
    for (int i = 0; i < n; ++i) {
      white_[i] = 0.0;
      for (int j = 0; j <= i; ++j) white_[i] += tuning.whitening(i, j) * z_[j];
    }
    levers_.setZero();
    const double observed = std::max(contact_.statistic, tuning.threshold);
    double largest = -std::numeric_limits<double>::infinity();
    int link = 0;
    const double per_length = 1.0 / length;
    for (int k = 0; k < n; ++k) {
      // A link feels the joints up to its own: joint k joins the sums W J.
      Vector6 column = certainty_[k] * jacobian.col(k);
      column.template tail<3>() *= per_length;
      for (int i = k; i < n; ++i) levers_.col(i) += tuning.whitening(i, k) * column;
      // The first look is at all links; then the others take turns beside the one that is pushed.
      const bool pushed = k == contact_.link;
      if (!(first || pushed || k == turn_)) continue;
      Push& push = pushes_[static_cast<std::size_t>(k)];
      push.point = placed_point(model, ws, k, tuning.joints[static_cast<std::size_t>(k)].contact_point);
      push.arm = push.point - centre;
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero();  // its lower triangle
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (int i = 0; i < n; ++i) {
        const double* const l = levers_.data() + 6 * i;
        const Eigen::Vector3d& arm = push.arm;
        const double j[3] = {l[0] + l[4] * arm.z() - l[5] * arm.y(), l[1] + l[5] * arm.x() - l[3] * arm.z(),
                             l[2] + l[3] * arm.y() - l[4] * arm.x()};
        for (int c = 0; c < 3; ++c) {
          b[c] += white_[i] * j[c];
          for (int r = c; r < 3; ++r) A(r, c) += j[r] * j[c];
        }
      }
      // Forces of this size make a statistic as observed, whatever their direction.
      const double prior = A.trace() > 0.0 ? A.trace() / observed : 1.0;
      A.diagonal().array() += prior;
      const double determinant = inverse(A, push.covariance);
      push.force = push.covariance * b;
      // Less what the joints' residual has of it: links are compared over different cycles. Twice the force
      // is half as likely.
      const double square = push.force.squaredNorm() + push.covariance.trace();
      const double evidence =
          0.5 * (b.dot(push.force) - contact_.statistic) +
          0.5 * std::log(std::max(prior * prior * prior / (determinant * square), 1e-300)) +
          tuning.log_extent[k];
      score_[k] += std::min((pushed ? 1.0 : n) * dt / located_, 1.0) * (evidence - score_[k]);
      if (!(score_[k] > largest)) continue;
      largest = score_[k];
      link = k;
    }
    contact_.link = link;
    contact_.point = pushes_[static_cast<std::size_t>(link)].point;
    mean_push(tuning.options.contact_size);
  }

  const Contact<N>& contact() const noexcept { return contact_; }

 private:
  static constexpr double sticks = 0.05;  // [s] of rest, then a joint sticks
  static constexpr double rests = 0.1;    // of its stiction speed
  static constexpr double memory = 0.5;   // [s] that the links are compared over

  void release() noexcept {
    contact_.detected = false;
    contact_.link = -1;
    contact_.wrench.setZero(), contact_.covariance.setZero(), contact_.point.setZero();
    score_.setZero();
    located_ = 0.0;
  }

  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  /// The push that explains the residual, if the link is pushed.
  struct Push {
    Eigen::Vector3d force, arm, point;  ///< [N]; [m] from the wrench's origin, in the base frame
    Eigen::Matrix3d covariance;         ///< [N^2]
  };

  // The wrench: mean and covariance over the links that may be pushed.
  void mean_push(double size) noexcept {
    constexpr double possible = 5.0;  // log probabilities below the best's that are looked at
    const int n = static_cast<int>(score_.size());
    double weights = 0.0;
    contact_.wrench.setZero(), contact_.covariance.setZero();
    for (int k = 0; k < n; ++k) {
      const double below = score_[contact_.link] - score_[k];
      if (!(below < possible)) continue;
      const Push& push = pushes_[static_cast<std::size_t>(k)];
      const double weight = k == contact_.link ? 1.0 : std::exp(-below);
      // The moment is that of the force at the point, which may be a little off.
      Eigen::Matrix3d cross, force_cross;
      cross << 0, -push.arm.z(), push.arm.y(), push.arm.z(), 0, -push.arm.x(), -push.arm.y(), push.arm.x(), 0;
      force_cross << 0, -push.force.z(), push.force.y(), push.force.z(), 0, -push.force.x(), -push.force.y(),
          push.force.x(), 0;
      const Eigen::Matrix3d moved = cross * push.covariance;
      Vector6 wrench;
      wrench << push.force, push.arm.cross(push.force);
      // Mean and second moment so far, by weight.
      weights += weight;
      const double share = weight / weights;
      const Vector6 off = wrench - contact_.wrench;
      contact_.wrench += share * off;
      Matrix6 C = (1.0 - share) * off * off.transpose();
      C.template topLeftCorner<3, 3>() += push.covariance;
      C.template bottomLeftCorner<3, 3>() += moved;
      C.template topRightCorner<3, 3>() += moved.transpose();
      C.template bottomRightCorner<3, 3>() +=
          moved * cross.transpose() + size * size * force_cross * force_cross.transpose();
      contact_.covariance += share * (C - contact_.covariance);
    }
  }

  // Of a symmetric matrix given by its lower triangle; returns its determinant.
  static double inverse(const Eigen::Matrix3d& A, Eigen::Matrix3d& C) noexcept {
    const double xx = A(1, 1) * A(2, 2) - A(2, 1) * A(2, 1), xy = A(2, 1) * A(2, 0) - A(1, 0) * A(2, 2),
                 xz = A(1, 0) * A(2, 1) - A(1, 1) * A(2, 0), yy = A(0, 0) * A(2, 2) - A(2, 0) * A(2, 0),
                 yz = A(1, 0) * A(2, 0) - A(0, 0) * A(2, 1), zz = A(0, 0) * A(1, 1) - A(1, 0) * A(1, 0);
    const double determinant = A(0, 0) * xx + A(1, 0) * xy + A(2, 0) * xz;
    C << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    C *= 1.0 / determinant;
    return determinant;
  }

  Vector score_, rest_, r_, z_, white_, certainty_;  // the last: 1 / sigma
  Eigen::Matrix<double, 6, N> levers_;               // of the joints' sums, angular rows last
  std::conditional_t<N == Eigen::Dynamic, std::vector<Push>,
                     std::array<Push, N == Eigen::Dynamic ? 1 : static_cast<std::size_t>(N)>>
      pushes_;
  Contact<N> contact_;
  double step_ = 0.0, share_ = 0.0;       // of the low-pass
  double settled_ = 0.0, located_ = 0.0;  // [s]
  int turn_ = 0;
};

}  // namespace dynid
