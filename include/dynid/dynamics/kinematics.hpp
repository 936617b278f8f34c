// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

/// Poses of the robot's link frames in the base frame.
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. poses: n + 1 of them,
/// written: links base to tip, then the tip; anything with `poses[i]` an Eigen::Transform<Scalar, 3,
/// Eigen::Isometry> and room enough (an array or a vector). Neither allocates nor throws.
template <int N, class Scalar, class Q, class Poses>
void forward_kinematics(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                        Poses&& poses) noexcept {
  using E = detail::ElementOf<Scalar>;
  using Lanes = detail::Element<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n);
  const Eigen::Matrix3d& base = model.base();
  for (int pass = 0; pass < Lanes::passes; ++pass) {
    detail::place<Scalar>(model, ws, q.derived(), pass);
    for (int i = 0; i <= n; ++i) {
      const int link = i < n ? i : n - 1;
      // Internal axes (columns of R) and origin in frame 0; the link's axes are R U^T, then base R U^T.
      const Eigen::Matrix3d U =
          i < n ? model.axes(i) : Eigen::Matrix3d(model.tip().linear().transpose() * model.axes(link));
      const Eigen::Vector3d offset = model.axes(link).transpose() * model.tip().translation();
      for (int r = 0; r < 3; ++r) {
        const auto in_base = [&](int row, int at) {
          return E(ws.row(row)[at] * base(r, 0) + ws.row(row + 1)[at] * base(r, 1) +
                   ws.row(row + 2)[at] * base(r, 2));
        };
        const E x = in_base(detail::row_x, link), y = in_base(detail::row_y, link),
                z = in_base(detail::row_z, link);
        E p = in_base(detail::row_p, link);
        if (i == n) p += x * offset.x() + y * offset.y() + z * offset.z();
        for (int c = 0; c < 3; ++c)
          Lanes::put(poses[i].matrix().coeffRef(r, c), pass, E(x * U(c, 0) + y * U(c, 1) + z * U(c, 2)));
        Lanes::put(poses[i].matrix().coeffRef(r, 3), pass, p);
        Lanes::put(poses[i].matrix().coeffRef(3, r), pass, E(0.0));
      }
      Lanes::put(poses[i].matrix().coeffRef(3, 3), pass, E(1.0));
    }
  }
}

/// A point of a link, where forward_kinematics() or jacobian() has just been called: no joint is placed
/// again.
///
/// ws: as either left it. link: 0 to n - 1. point [m]: in the link's frame. Returns it in the base frame [m].
/// Neither allocates nor throws.
template <int N>
Eigen::Vector3d placed_point(const Model<N>& model, Workspace<N>& ws, int link,
                             const Eigen::Vector3d& point) noexcept {
  const Eigen::Vector3d r = model.axes(link).transpose() * point;
  Eigen::Vector3d in_zero;
  for (int k = 0; k < 3; ++k)
    in_zero[k] = ws.row(detail::row_p + k)[link] + ws.row(detail::row_x + k)[link] * r.x() +
                 ws.row(detail::row_y + k)[link] * r.y() + ws.row(detail::row_z + k)[link] * r.z();
  return model.base() * in_zero;
}

/// Geometric Jacobian of a point fixed in the last link.
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. `point`: a pose in the last
/// link's frame, of which only the origin matters. J: 6 x n, written whole, any writable Eigen matrix of that
/// size: J dq is the point's velocity [m/s] (rows 0-2) and the link's angular velocity [rad/s] (rows 3-5),
/// both in the axes of the base frame. Neither allocates nor throws.
template <int N, class Scalar, class Q, class Out>
void jacobian(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
              const Eigen::Isometry3d& point, Out&& J) noexcept {
  using E = detail::ElementOf<Scalar>;
  using Lanes = detail::Element<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n && J.rows() == 6 && J.cols() == n);
  const Eigen::Matrix3d& base = model.base();
  const Eigen::Vector3d r = model.axes(n - 1).transpose() * point.translation();
  const detail::Rows3<E> rx(ws, detail::row_x), ry(ws, detail::row_y), rz(ws, detail::row_z),
      rp(ws, detail::row_p);
  const detail::Rows3<E> rw(ws, detail::row_w), rv(ws, detail::row_v);
  for (int pass = 0; pass < Lanes::passes; ++pass) {
    detail::place<Scalar>(model, ws, q.derived(), pass);
    detail::place_twists<E>(model, ws);
    const detail::Vector3<E> p =
        detail::sum(detail::sum(detail::sum(rp.template get<E>(n - 1), r.x(), rx.template get<E>(n - 1)),
                                r.y(), ry.template get<E>(n - 1)),
                    r.z(), rz.template get<E>(n - 1));
    for (int i = 0; i < n; ++i) {
      const detail::Vector3<E> w = rw.template get<E>(i);
      const detail::Vector3<E> v = detail::sum(rv.template get<E>(i), detail::cross(w, p));
      for (int k = 0; k < 3; ++k) {
        Lanes::put(J.coeffRef(k, i), pass, E(v.x * base(k, 0) + v.y * base(k, 1) + v.z * base(k, 2)));
        Lanes::put(J.coeffRef(3 + k, i), pass, E(w.x * base(k, 0) + w.y * base(k, 1) + w.z * base(k, 2)));
      }
    }
  }
}

/// The same at the robot's tip.
template <int N, class Scalar, class Q, class Out>
void jacobian(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
              Out&& J) noexcept {
  jacobian(model, ws, q, model.tip(), J);
}

}  // namespace dynid
