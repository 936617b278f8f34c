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
        levers_(n, 6),
        push_(n, 3) {
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
    Vector6 unscaled;
    unscaled.template head<3>().setOnes(), unscaled.template tail<3>().setConstant(1.0 / length);
    const int last = first ? n - 1 : std::max(contact_.link, turn_);
    for (int k = 0; k <= last; ++k) {
      // A link feels the joints up to its own: joint k joins the sums W J.
      const Vector6 column = certainty_[k] * jacobian.col(k).cwiseProduct(unscaled);
      for (int c = 0; c < 6; ++c) levers_.col(c) += column[c] * tuning.whitening.col(k);
      // The first look is at all links; then the others take turns beside the one that is pushed.
      const bool pushed = k == contact_.link;
      if (!(first || pushed || k == turn_)) continue;
      Push& push = pushes_[static_cast<std::size_t>(k)];
      push.point = placed_point(model, ws, k, tuning.joints[static_cast<std::size_t>(k)].contact_point);
      const Eigen::Vector3d arm = push.point - centre;
      // The joints' answer to a force there, one direction a column.
      push_.col(0) = levers_.col(0) + arm.z() * levers_.col(4) - arm.y() * levers_.col(5);
      push_.col(1) = levers_.col(1) + arm.x() * levers_.col(5) - arm.z() * levers_.col(3);
      push_.col(2) = levers_.col(2) + arm.y() * levers_.col(3) - arm.x() * levers_.col(4);
      Eigen::Matrix3d A;  // its lower triangle
      Eigen::Vector3d b;
      for (int c = 0; c < 3; ++c) {
        b[c] = white_.dot(push_.col(c));
        for (int r = c; r < 3; ++r) A(r, c) = push_.col(r).dot(push_.col(c));
      }
      // Forces of this size make a statistic as observed, whatever their direction.
      const double prior = A.trace() > 0.0 ? A.trace() / observed : 1.0;
      A.diagonal().array() += prior;
      Eigen::Matrix3d covariance;
      const double determinant = inverse(A, covariance);
      const Eigen::Vector3d force = covariance * b;
      set_wrench(push, force, covariance, arm, tuning.options.contact_size);
      // Less what the joints' residual has of it: links are compared over different cycles. Twice the force
      // is half as likely.
      const double square = force.squaredNorm() + covariance.trace();
      const double evidence =
          0.5 * (b.dot(force) - contact_.statistic) +
          0.5 * std::log(std::max(prior * prior * prior / (determinant * square), 1e-300)) +
          tuning.log_extent[k];
      score_[k] += std::min((pushed ? 1.0 : n) * dt / located_, 1.0) * (evidence - score_[k]);
      if (!(score_[k] > largest)) continue;
      largest = score_[k];
      link = k;
    }
    contact_.link = link;
    contact_.point = pushes_[static_cast<std::size_t>(link)].point;
    mean_push();
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
    Eigen::Vector3d point;  ///< [m] in the base frame
    Vector6 wrench;         ///< about the wrench's origin
    Matrix6 covariance;
  };

  /// The wrench of a force with the covariance P [N^2] on a point at `arm` [m] from the wrench's origin,
  /// which may be off by `size` [m].
  static void set_wrench(Push& push, const Eigen::Vector3d& force, const Eigen::Matrix3d& P,
                         const Eigen::Vector3d& arm, double size) noexcept {
    push.wrench << force, arm.cross(force);
    // [arm] P, column by column, and from its rows [arm] P [arm]^T.
    Eigen::Matrix3d moved, moment;
    for (int c = 0; c < 3; ++c) moved.col(c) = arm.cross(P.col(c));
    for (int r = 0; r < 3; ++r) moment.col(r) = arm.cross(moved.row(r).transpose());
    moment -= size * size * force * force.transpose();
    moment.diagonal().array() += size * size * force.squaredNorm();
    push.covariance.template topLeftCorner<3, 3>() = P;
    push.covariance.template bottomLeftCorner<3, 3>() = moved;
    push.covariance.template topRightCorner<3, 3>() = moved.transpose();
    push.covariance.template bottomRightCorner<3, 3>() = 0.5 * (moment + moment.transpose());
  }

  // The wrench: mean and covariance over the links that may be pushed.
  void mean_push() noexcept {
    constexpr double possible = 5.0;  // log probabilities below the best's that are looked at
    const int n = static_cast<int>(score_.size());
    const Push& best = pushes_[static_cast<std::size_t>(contact_.link)];
    double weights = 1.0;
    Vector6 off = Vector6::Zero();
    contact_.covariance = best.covariance;
    for (int k = 0; k < n; ++k) {
      const double below = score_[contact_.link] - score_[k];
      if (k == contact_.link || !(below < possible)) continue;
      const Push& push = pushes_[static_cast<std::size_t>(k)];
      const double weight = std::exp(-below);
      const Vector6 by = push.wrench - best.wrench, weighted = weight * by;
      weights += weight;
      off += weighted;
      contact_.covariance += weight * push.covariance;
      contact_.covariance.noalias() += weighted * by.transpose();
    }
    off *= 1.0 / weights;
    contact_.wrench = best.wrench + off;
    contact_.covariance *= 1.0 / weights;
    contact_.covariance.noalias() -= off * off.transpose();
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
  Eigen::Matrix<double, N, 6> levers_;               // of the joints' sums, angular ones last
  Eigen::Matrix<double, N, 3> push_;
  std::conditional_t<N == Eigen::Dynamic, std::vector<Push>,
                     std::array<Push, N == Eigen::Dynamic ? 1 : static_cast<std::size_t>(N)>>
      pushes_;
  Contact<N> contact_;
  double step_ = 0.0, share_ = 0.0;       // of the low-pass
  double settled_ = 0.0, located_ = 0.0;  // [s]
  int turn_ = 0;
};

}  // namespace dynid
