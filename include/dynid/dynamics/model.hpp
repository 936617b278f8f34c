// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

namespace detail {

/// n values of type T: in place when N is fixed, on the heap when it is Eigen::Dynamic.
template <class T, int N>
using JointArray =
    std::conditional_t<N == Eigen::Dynamic, std::vector<T>, std::array<T, N == Eigen::Dynamic ? 1 : N>>;

template <class T, int N>
void resize(JointArray<T, N>& values, int n) {
  if constexpr (N == Eigen::Dynamic) values.resize(n);
}

/// Pose of the internal frame of link i in that of link i - 1: rotation Rx(alpha) Rz(theta + q), origin p; a
/// prismatic joint has q in the origin, p + q (0, -sin alpha, cos alpha), instead of in the angle.
struct JointFrame {
  double ca, sa;      // cos, sin of alpha
  double px, py, pz;  // [m]
  double revolute;    // 1, or 0 for a prismatic joint
};

/// Mass, first moment and second moment Sigma = integral of r r^T dm (so J = tr(Sigma) 1 - Sigma) of one link
/// about the origin of its internal frame, in its axes. Sigma is the block of the pseudo-inertia.
struct LinkMoments {
  double m, hx, hy, hz, xx, xy, yy, xz, yz, zz;
};

}  // namespace detail

/// The compiled, immutable-in-use form of a Robot that the kernels read. N: number of joints, or
/// Eigen::Dynamic.
///
/// Internal frames. Link i keeps the origin of its link frame; its axes are turned once so that z is the
/// joint axis and x is perpendicular to the next joint's axis too. Every joint is then two plane rotations,
/// Rx(alpha) and Rz(theta + q), whatever the axes of the robot's own frames. The first two factors are folded
/// into the base.
///
/// Regrouping. A mass on the axis of a revolute joint moves with both its links alike, so m, h_z and Sigma_zz
/// of a link may be given to the link before without changing any joint torque. Kernels that return only
/// joint-space quantities use these reduced moments (seven a link); joint_wrenches() and the energies use the
/// true ones.
///
/// Construction throws Error and, like set_parameters(), is not for a control loop. Kernels never change a
/// Model: one may be shared by any number of threads, each with its own Workspace.
template <int N = Eigen::Dynamic>
class Model {
 public:
  static_assert(N == Eigen::Dynamic || N > 0);
  static constexpr int fixed_size = N;

  /// Throws Error when the robot has another number of joints than N, or none, or a quantity that is not
  /// finite, an axis that is not a unit vector or an origin that is not a rigid motion. Rotor inertia and
  /// friction are not used.
  explicit Model(const Robot& robot) {
    n_ = robot.size();
    if (n_ < 1) throw Error("robot '" + robot.name + "': no joint");
    if (N != Eigen::Dynamic && n_ != N)
      throw Error("robot '" + robot.name + "': has " + std::to_string(n_) + " joints, the model is for " +
                  std::to_string(N));
    compile(robot);
    for (int i = 0; i < n_; ++i) {
      if (!robot.joints[i].parameters.allFinite())
        throw Error("link '" + robot.joints[i].link_name + "': a standard parameter is not finite");
      set_link(i, robot.joints[i].parameters);
    }
    regroup();
    if (!robot.gravity.allFinite()) throw Error("robot '" + robot.name + "': gravity is not finite");
    set_gravity(robot.gravity);
  }

  /// Number of joints n.
  int size() const noexcept { return N == Eigen::Dynamic ? n_ : N; }
  /// Gravity [m/s^2], in the base frame.
  const Eigen::Vector3d& gravity() const noexcept { return gravity_; }
  /// Pose of the tip in the last link's frame.
  const Eigen::Isometry3d& tip() const noexcept { return tip_; }

  /// Any gravity vector [m/s^2], in the base frame. Does not allocate.
  void set_gravity(const Eigen::Vector3d& gravity) noexcept {
    gravity_ = gravity;
    base_gravity_ = base_.transpose() * gravity;
  }
  /// A copy under another gravity.
  Model with_gravity(const Eigen::Vector3d& gravity) const {
    Model copy = *this;
    copy.set_gravity(gravity);
    return copy;
  }

  /// Standard parameters pi (10 n) in the robot's link frames, links base to tip. Throws Error on a wrong
  /// size.
  void set_parameters(const Eigen::Ref<const Eigen::VectorXd>& pi) {
    if (pi.size() != 10 * size())
      throw Error("standard parameters: " + std::to_string(pi.size()) + " values given, " +
                  std::to_string(10 * size()) + " needed");
    for (int i = 0; i < size(); ++i) set_link(i, pi.segment<10>(10 * i));
    regroup();
  }
  /// A copy with other parameters.
  Model with_parameters(const Eigen::Ref<const Eigen::VectorXd>& pi) const {
    Model copy = *this;
    copy.set_parameters(pi);
    return copy;
  }

  // What the kernels read; see the class comment. Angles [rad], lengths [m], moments [kg, kg m, kg m^2].
  bool has_prismatic() const noexcept { return has_prismatic_; }
  /// The internal frames have the axes of the robot's link frames (as with modified DH rows).
  bool frames_are_links() const noexcept { return frames_are_links_; }
  const detail::JointFrame& frame(int i) const noexcept { return frames_[i]; }
  const double* theta() const noexcept { return theta_.data(); }                    ///< n
  const double* revolute() const noexcept { return revolute_.data(); }              ///< n, ones and zeros
  const detail::LinkMoments& moments(int i) const noexcept { return moments_[i]; }  ///< the true ones
  const detail::LinkMoments& reduced(int i) const noexcept { return reduced_[i]; }  ///< the regrouped ones
  /// Row k of the reduced moments, over links, in the order of LinkMoments.
  const double* reduced_row(int k) const noexcept { return reduced_rows_[k].data(); }
  const Eigen::Matrix3d& base() const noexcept {
    return base_;
  }  ///< axes of internal frame 0, in the base frame
  const Eigen::Vector3d& base_gravity() const noexcept { return base_gravity_; }  ///< in internal frame 0
  /// Axes of the internal frame of link i, in the robot's link frame i.
  const Eigen::Matrix3d& axes(int i) const noexcept { return axes_[i]; }

 private:
  // The rotation that takes z to `axis` by the shortest way: the identity when they coincide.
  static Eigen::Matrix3d upright(const Eigen::Vector3d& axis) {
    const Eigen::Vector3d z = Eigen::Vector3d::UnitZ(), to = axis.normalized();
    if (axis == z) return Eigen::Matrix3d::Identity();
    // As Eigen's FromTwoVectors(), whose singular value decomposition takes a compiler seconds.
    const double c = to.dot(z);
    Eigen::Quaterniond q;
    if (c < -1.0 + 1e-12) {  // half a turn, about any axis across
      const Eigen::Vector3d across = z.cross(to);
      const double w2 = 0.5 * (1.0 + std::max(c, -1.0));
      q.w() = std::sqrt(w2);
      q.vec() =
          (across.norm() > 0.0 ? Eigen::Vector3d(across.normalized()) : Eigen::Vector3d(-1.0, 0.0, 0.0)) *
          std::sqrt(1.0 - w2);
    } else {
      const double s = std::sqrt(2.0 * (1.0 + c));
      q.w() = 0.5 * s;
      q.vec() = z.cross(to) * (1.0 / s);
    }
    return q.toRotationMatrix();
  }

  void compile(const Robot& robot) {
    constexpr double rounding = 1e-15;
    detail::resize<detail::JointFrame, N>(frames_, n_);
    detail::resize<double, N>(theta_, n_);
    detail::resize<double, N>(revolute_, n_);
    detail::resize<Eigen::Matrix3d, N>(axes_, n_);
    detail::resize<detail::LinkMoments, N>(moments_, n_);
    detail::resize<detail::LinkMoments, N>(reduced_, n_);
    for (auto& row : reduced_rows_) detail::resize<double, N>(row, n_);

    for (int i = 0; i < n_; ++i) {
      const Joint& joint = robot.joints[i];
      const Eigen::Matrix3d R = joint.origin.linear();
      if (!joint.origin.matrix().allFinite() || !joint.axis.allFinite())
        throw Error("joint '" + joint.name + "': origin or axis is not finite");
      if (std::abs(joint.axis.norm() - 1.0) > 1e-9)
        throw Error("joint '" + joint.name + "': the axis is not a unit vector");
      if (!(R * R.transpose()).isIdentity(1e-9) || R.determinant() < 0.0)
        throw Error("joint '" + joint.name + "': the origin is not a rigid motion");
    }
    has_prismatic_ = false;
    frames_are_links_ = true;
    for (int i = 0; i < n_; ++i) {
      const Eigen::Vector3d z = robot.joints[i].axis.normalized();
      Eigen::Matrix3d& A = axes_[i];
      A = upright(z);
      if (i + 1 < n_) {  // turn x about z until it is perpendicular to the next axis as well
        const Eigen::Vector3d next =
            robot.joints[i + 1].origin.linear() * robot.joints[i + 1].axis.normalized();
        const Eigen::Vector3d across = z.cross(next);
        if (across.norm() > rounding && std::abs(A.col(0).dot(next)) > rounding) {
          // However small `across` is, x . next stays at rounding: x is made exactly perpendicular to z.
          Eigen::Vector3d x = across / across.norm();
          x = (x - z * z.dot(x)).normalized();
          A << x, z.cross(x), z;
        }
      }
      if (!A.isIdentity(0.0)) frames_are_links_ = false;
    }
    base_ = robot.joints[0].origin.linear() * axes_[0];
    for (int i = 0; i < n_; ++i) {
      const Joint& joint = robot.joints[i];
      const Eigen::Matrix3d& before = i > 0 ? axes_[i - 1] : base_;
      const Eigen::Matrix3d R = i > 0 ? Eigen::Matrix3d(before.transpose() * joint.origin.linear() * axes_[i])
                                      : Eigen::Matrix3d::Identity();
      const Eigen::Vector3d p = i > 0 ? Eigen::Vector3d(before.transpose() * joint.origin.translation())
                                      : Eigen::Vector3d(base_.transpose() * joint.origin.translation());
      const double norm = std::hypot(R(1, 2), R(2, 2)), ca = R(2, 2) / norm, sa = -R(1, 2) / norm;
      const bool revolute = joint.type != JointType::prismatic;
      frames_[i] = {ca, sa, p.x(), p.y(), p.z(), revolute ? 1.0 : 0.0};
      theta_[i] = std::atan2(ca * R(1, 0) + sa * R(2, 0), R(0, 0));
      revolute_[i] = revolute ? 1.0 : 0.0;
      if (!revolute) has_prismatic_ = true;
    }
    tip_ = robot.tip;
    if (!tip_.matrix().allFinite()) throw Error("robot '" + robot.name + "': the tip's pose is not finite");
  }

  void set_link(int i, const StandardParameters& p) noexcept {
    const Eigen::Matrix3d J = inertia_tensor(p);
    const Eigen::Matrix3d& A = axes_[i];
    const Eigen::Vector3d h = A.transpose() * p.segment<3>(1);
    const Eigen::Matrix3d S = A.transpose() * (0.5 * J.trace() * Eigen::Matrix3d::Identity() - J) * A;
    moments_[i] = {p[0], h.x(), h.y(), h.z(), S(0, 0), S(0, 1), S(1, 1), S(0, 2), S(1, 2), S(2, 2)};
  }

  void regroup() noexcept {
    for (int i = 0; i < size(); ++i) reduced_[i] = moments_[i];
    for (int i = size() - 1; i >= 0; --i) {
      detail::LinkMoments& link = reduced_[i];
      const detail::JointFrame& f = frames_[i];
      if (f.revolute == 0.0) continue;
      if (i > 0) {
        // A rod along the axis, its points at p + s z for s along it, seen from the link before.
        const Eigen::Vector3d p(f.px, f.py, f.pz), z(0.0, -f.sa, f.ca);
        const Eigen::Vector3d h = link.m * p + link.hz * z;
        const Eigen::Matrix3d S =
            p * h.transpose() + link.hz * z * p.transpose() + link.zz * z * z.transpose();
        detail::LinkMoments& before = reduced_[i - 1];
        before.m += link.m;
        before.hx += h.x(), before.hy += h.y(), before.hz += h.z();
        before.xx += S(0, 0), before.xy += S(0, 1), before.yy += S(1, 1);
        before.xz += S(0, 2), before.yz += S(1, 2), before.zz += S(2, 2);
      }
      link.m = link.hz = link.zz = 0.0;
    }
    for (int i = 0; i < size(); ++i) {
      const detail::LinkMoments& r = reduced_[i];
      const double values[10] = {r.m, r.hx, r.hy, r.hz, r.xx, r.xy, r.yy, r.xz, r.yz, r.zz};
      for (int k = 0; k < 10; ++k) reduced_rows_[k][i] = values[k];
    }
  }

  int n_ = 0;
  bool has_prismatic_ = false, frames_are_links_ = true;
  detail::JointArray<detail::JointFrame, N> frames_;
  detail::JointArray<double, N> theta_, revolute_;
  detail::JointArray<detail::LinkMoments, N> moments_, reduced_;
  std::array<detail::JointArray<double, N>, 10> reduced_rows_;
  detail::JointArray<Eigen::Matrix3d, N> axes_;
  Eigen::Matrix3d base_;
  Eigen::Vector3d gravity_, base_gravity_;
  Eigen::Isometry3d tip_ = Eigen::Isometry3d::Identity();
};

}  // namespace dynid
