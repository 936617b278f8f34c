// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

/// Turns a vector from an internal frame into the robot's link frame of the same link.
template <class V>
[[gnu::always_inline]] inline Vector3<V> turned(const Eigen::Matrix3d& R, const Vector3<V>& a) {
  return {V(a.x * R(0, 0) + a.y * R(0, 1) + a.z * R(0, 2)), V(a.x * R(1, 0) + a.y * R(1, 1) + a.z * R(1, 2)),
          V(a.x * R(2, 0) + a.y * R(2, 1) + a.z * R(2, 2))};
}

/// Each joint's unit twist is carried outwards, link by link (lanes are joints), and the power it does on a
/// link moving as that link does is read off, parameter by parameter:
///   v . (m a + L h) + w . (h x a + J alpha + omega x J omega).
template <bool prismatic, class V, int N, class S, class Q, class D, class A, class Y>
[[gnu::always_inline]] inline void regressor(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                             const D& dq, const A& ddq, Y& out, int pass) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int n = model.size();
  const bool turn = !model.frames_are_links();
  E *const c = ws.row(0), *const s = ws.row(1);
  const Rows3<E> rp(ws, 2), romega(ws, 5), ralpha(ws, 8), ra(ws, 11);
  const Rows3<E> rx(ws, 14), ry(ws, 17), rz(ws, 20);  // columns of L
  joint_rotations<S>(model, q, pass, c, s);

  Motion<E> motion = base_motion<E>(model);
  for (int i = 0; i < n; ++i) {
    const JointFrame& frame = model.frame(i);
    const E qi = prismatic ? coefficient<S>(q, i, pass) : E(0.0);
    const E dqi = coefficient<S>(dq, i, pass), ddqi = coefficient<S>(ddq, i, pass);
    motion = prismatic || i > 0 ? step<prismatic>(frame, motion, c[i], s[i], qi, dqi, ddqi)
                                : first_step(motion, c[i], s[i], dqi, ddqi);
    Vector3<E> omega = motion.omega, alpha = motion.alpha, a = motion.a;
    Spin<E> L = motion.spin;
    if (turn) {
      const Eigen::Matrix3d& axes = model.axes(i);
      omega = turned(axes, omega), alpha = turned(axes, alpha), a = turned(axes, a);
      L = Spin<E>(omega, alpha);
    }
    rp.set(i, origin<prismatic>(frame, qi));
    romega.set(i, omega), ralpha.set(i, alpha), ra.set(i, a);
    rx.set(i, Vector3<E>{L.xx, L.yx, L.zx});
    ry.set(i, Vector3<E>{L.xy, L.yy, L.zy});
    rz.set(i, Vector3<E>{L.xz, L.yz, L.zz});
  }

  for (int g = 0; g * lanes < n; ++g) {
    const int first = first_of_group<lanes>(g, n);
    for (int column = 0; column < 10 * first; ++column) write_rows<S>(out, first, column, pass, V(0.0));
    const V zero(0.0);
    Vector3<V> w = {zero, zero, zero}, v = w;
    for (int i = first; i < n; ++i) {
      const JointFrame& frame = model.frame(i);
      const V cv(c[i]), sv(s[i]), ca(frame.ca), sa(frame.sa);
      if (i > first) {  // nothing moves before
        v = to_link(sum(v, cross(w, rp.template all<V>(i))), ca, sa, cv, sv);
        w = to_link(w, ca, sa, cv, sv);
      }
      if (i < first + lanes) {
        const V unit = unit_lane<V, E>(first, i);
        if constexpr (prismatic) {
          w.z += unit * V(frame.revolute);
          v.z += unit * V(1.0 - frame.revolute);
        } else {
          w.z += unit;
        }
      }
      Vector3<V> W = w, U = v;  // in the robot's link frame
      if (turn) W = turned(model.axes(i), w), U = turned(model.axes(i), v);

      const int column = 10 * i;
      const auto write = [&](int k, const V& x) { write_rows<S>(out, first, column + k, pass, x); };
      const Vector3<V> a = ra.template all<V>(i), aw = cross(a, W);
      write(0, dot(U, a));
      write(1, aw.x + dot(U, rx.template all<V>(i)));
      write(2, aw.y + dot(U, ry.template all<V>(i)));
      write(3, aw.z + dot(U, rz.template all<V>(i)));
      const Vector3<V> omega = romega.template all<V>(i), alpha = ralpha.template all<V>(i),
                       u = cross(W, omega);
      write(4, W.x * alpha.x + u.x * omega.x);
      write(5, W.x * alpha.y + W.y * alpha.x + u.x * omega.y + u.y * omega.x);
      write(6, W.y * alpha.y + u.y * omega.y);
      write(7, W.x * alpha.z + W.z * alpha.x + u.x * omega.z + u.z * omega.x);
      write(8, W.y * alpha.z + W.z * alpha.y + u.y * omega.z + u.z * omega.y);
      write(9, W.z * alpha.z + u.z * omega.z);
    }
  }
}

}  // namespace detail

/// Joint-torque regressor, eq. (5): Y(q, dq, ddq) pi equals inverse_dynamics() for every pi.
///
/// q [rad or m], dq, ddq: n, joints base to tip, any Eigen column expression of `Scalar`.
/// Y: n x 10 n, written whole; any writable Eigen matrix already of that size (a column-major one is
/// quickest). Columns: links base to tip, each `m, mx, my, mz, xx, xy, yy, xz, yz, zz` in the *robot's* link
/// frame, as Robot::parameters(). Neither allocates nor throws.
template <int N, class Scalar, class Q, class V, class A, class Y>
void regressor(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
               const Eigen::MatrixBase<V>& dq, const Eigen::MatrixBase<A>& ddq, Y&& out) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size() && ddq.size() == model.size());
  eigen_assert(out.rows() == model.size() && out.cols() == 10 * model.size());
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::with_lanes<detail::ElementOf<Scalar>>(model, [&](auto lane) {
      using L = decltype(lane);
      if (model.has_prismatic())
        detail::regressor<true, L>(model, ws, q.derived(), dq.derived(), ddq.derived(), out, pass);
      else
        detail::regressor<false, L>(model, ws, q.derived(), dq.derived(), ddq.derived(), out, pass);
    });
  }
}

}  // namespace dynid
