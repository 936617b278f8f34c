// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/kinematics.hpp"

namespace dynid {

/// In whose axes a wrench is given.
enum class WrenchAxes { base, frame };

struct ExternalWrenchOptions {
  WrenchAxes axes = WrenchAxes::base;
  /// L [m]: a moment of L x 1 N m weighs as much as a force of 1 N where the two are compared.
  double length = 0.25;
  /// eps [m]: below this margin (see ExternalWrench) the wrench is flagged and damped.
  double singular_below = 0.04;
};

/// Wrench of the environment on the robot, F, from the external joint torques: tau_ext = J^T F in the least
/// squares sense, with the damped inverse F = (J J^T + lambda^2 1)^-1 J tau_ext.
///
/// Angular rows of J are scaled by L, so that all are in metres. The margin d = tr((J J^T)^-1)^-1/2 lies
/// between sigma_min/sqrt(6) and sigma_min, the smallest singular value, and tends to it at a singularity.
/// lambda^2 = eps^2 - d^2 below eps and zero above: the answer is continuous in q and at most |tau_ext| /
/// (2 eps) long at a singularity. An arm of fewer than six joints cannot feel every wrench: it is always near
/// a singularity, and the answer is the smallest wrench that explains the torques.
template <int N = Eigen::Dynamic>
class ExternalWrench {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// `frame`: pose of the frame in the last link's frame; the wrench is about its origin. Throws Error on an
  /// option that is not positive or a pose that is not finite. Allocates when N is Eigen::Dynamic.
  ExternalWrench(const Model<N>& model, const Eigen::Isometry3d& frame,
                 const ExternalWrenchOptions& options = {})
      : jacobian_(6, model.size()), frame_(frame), options_(options) {
    if (!(options.length > 0.0) || !std::isfinite(options.length))
      throw Error("external wrench: the length must be positive");
    if (!(options.singular_below > 0.0) || !std::isfinite(options.singular_below))
      throw Error("external wrench: the singularity's margin must be positive");
    if (!frame.matrix().allFinite()) throw Error("external wrench: the frame's pose is not finite");
  }

  /// q [rad or m], tau_ext [N m or N]: n, finite. Returns F: force [N] (0-2) and moment [N m] (3-5) of the
  /// environment on the robot. Neither allocates nor throws.
  template <class Q, class T>
  const Vector6& update(const Model<N>& model, Workspace<N>& ws, const Eigen::MatrixBase<Q>& q,
                        const Eigen::MatrixBase<T>& tau_ext) noexcept {
    const int n = model.size();
    jacobian(model, ws, q, frame_, jacobian_);
    for (int i = 0; i < n; ++i) jacobian_.col(i).template tail<3>() *= options_.length;

    // The lower triangle of J J^T, two columns at a time.
    Matrix6 A;
    each(
        [&](auto pair) {
          constexpr int c = 2 * decltype(pair)::value;
          Eigen::Matrix<double, 6 - c, 1> one, two;
          one.setZero(), two.setZero();
          for (int i = 0; i < n; ++i) {
            const auto j = jacobian_.col(i).template tail<6 - c>();
            one += j[0] * j, two += j[1] * j;
          }
          A.col(c).template tail<6 - c>() = one, A.col(c + 1).template tail<6 - c>() = two;
        },
        std::make_integer_sequence<int, 3>());
    Vector6 b = Vector6::Zero();
    for (int i = 0; i < n; ++i) b += tau_ext.coeff(i) * jacobian_.col(i);
    // A trace's 1e-12 keeps the factor real at a singularity; it is far below any margin that is not flagged.
    const double floor = 1e-12 * A.trace() + 1e-300;
    Factor L;
    factor(A, floor, L);
    margin_ = 1.0 / std::sqrt(inverse_trace(L));
    near_singular_ = !(margin_ >= options_.singular_below);
    if (near_singular_) {
      const double eps = options_.singular_below, d = std::min(margin_, eps);
      factor(A, eps * eps - d * d + floor, L);
    }
    solve(L, b);
    b.template tail<3>() *= options_.length;
    if (options_.axes == WrenchAxes::frame) {
      // jacobian() has left the axes of the last link's internal frame in the workspace.
      Eigen::Matrix3d axes;
      for (int k = 0; k < 3; ++k)
        axes.row(k) << ws.row(detail::row_x + k)[n - 1], ws.row(detail::row_y + k)[n - 1],
            ws.row(detail::row_z + k)[n - 1];
      const Eigen::Matrix3d link = frame_.linear().transpose() * model.axes(n - 1);
      const auto turned = [&](const Eigen::Vector3d& x) {
        const Eigen::Vector3d in_zero = model.base().transpose() * x;
        const Eigen::Vector3d in_last = axes.transpose() * in_zero;
        return Eigen::Vector3d(link * in_last);
      };
      wrench_.template head<3>() = turned(b.template head<3>());
      wrench_.template tail<3>() = turned(b.template tail<3>());
    } else {
      wrench_ = b;
    }
    return wrench_;
  }

  const Vector6& wrench() const noexcept { return wrench_; }
  bool near_singular() const noexcept { return near_singular_; }
  double margin() const noexcept { return margin_; }  ///< d [m]
  /// J of the last update(), 6 x n, its angular rows times L.
  const Eigen::Matrix<double, 6, N>& scaled_jacobian() const noexcept { return jacobian_; }
  double length() const noexcept { return options_.length; }          ///< L [m]
  const Eigen::Isometry3d& frame() const noexcept { return frame_; }  ///< in the last link's frame

 private:
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  /// f(0), f(1), ... with constants, so that a loop of six is none.
  template <class F, int... i>
  [[gnu::always_inline]] static void each(const F& f, std::integer_sequence<int, i...>) noexcept {
    (f(std::integral_constant<int, i>()), ...);
  }
  using Six = std::make_integer_sequence<int, 6>;

  /// A + shift 1 = L D L^T, L with 1 on its diagonal.
  struct Factor {
    double L[6][6], inverse[6];  // of D
  };
  static void factor(const Matrix6& A, double shift, Factor& out) noexcept {
    double x[6][6];  // L D
    each(
        [&](auto column) {
          constexpr int c = decltype(column)::value;
          double pivot = A(c, c) + shift;
          for (int k = 0; k < c; ++k) pivot -= x[c][k] * out.L[c][k];
          out.inverse[c] = 1.0 / std::max(pivot, 0.5 * shift);
          for (int r = c + 1; r < 6; ++r) {
            x[r][c] = A(r, c);
            for (int k = 0; k < c; ++k) x[r][c] -= x[r][k] * out.L[c][k];
            out.L[r][c] = x[r][c] * out.inverse[c];
          }
        },
        Six());
  }
  // tr((L D L^T)^-1), from the columns of L^-1.
  static double inverse_trace(const Factor& in) noexcept {
    double sum = 0.0;
    each(
        [&](auto column) {
          constexpr int c = decltype(column)::value;
          double x[6];
          sum += in.inverse[c];
          for (int r = c + 1; r < 6; ++r) {
            x[r] = -in.L[r][c];
            for (int k = c + 1; k < r; ++k) x[r] -= in.L[r][k] * x[k];
            sum += x[r] * x[r] * in.inverse[r];
          }
        },
        Six());
    return sum;
  }
  static void solve(const Factor& in, Vector6& b) noexcept {
    for (int r = 1; r < 6; ++r)
      for (int k = 0; k < r; ++k) b[r] -= in.L[r][k] * b[k];
    for (int r = 0; r < 6; ++r) b[r] *= in.inverse[r];
    for (int r = 4; r >= 0; --r)
      for (int k = r + 1; k < 6; ++k) b[r] -= in.L[k][r] * b[k];
  }

  Eigen::Matrix<double, 6, N> jacobian_;
  Eigen::Isometry3d frame_;
  ExternalWrenchOptions options_;
  Vector6 wrench_ = Vector6::Zero();
  double margin_ = 0.0;
  bool near_singular_ = false;
};

}  // namespace dynid
