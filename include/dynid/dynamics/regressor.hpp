// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/detail/write.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

/// Turns a vector from an internal frame into the robot's link frame of the same link.
template <class V>
[[gnu::always_inline]] inline Vector3<V> turned(const Eigen::Matrix3d& R, const Vector3<V>& a) {
  return {V(a.x * R(0, 0) + a.y * R(0, 1) + a.z * R(0, 2)), V(a.x * R(1, 0) + a.y * R(1, 1) + a.z * R(1, 2)),
          V(a.x * R(2, 0) + a.y * R(2, 1) + a.z * R(2, 2))};
}

/// Link by link: each joint's unit twist is carried outwards (lanes are joints), and the power it does on
/// link i moving as it does is read off, parameter by parameter:
///   v . (m a + L h) + w . (h x a + J alpha + omega x J omega).
template <bool prismatic, class V, int N, class S, class Q, class D, class A, class Y>
[[gnu::always_inline]] inline void regressor(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                             const D& dq, const A& ddq, Y& out, int pass) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int n = model.size(), groups = (n + lanes - 1) / lanes;
  E *const c = ws.row(0), *const s = ws.row(1);
  E* const wx = ws.row(2);
  E* const wy = ws.row(3);
  E* const wz = ws.row(4);
  E* const vx = ws.row(5);
  E* const vy = ws.row(6);
  E* const vz = ws.row(7);
  joint_rotations<S>(model, q, pass, c, s);

  // Twists are kept by group, `lanes` elements each: groups overlap in joints, not in storage. A group's 4
  // elements never pass the end of a row: groups * lanes <= padded n.
  for (int k = 0; k < groups * lanes; ++k) wx[k] = wy[k] = wz[k] = vx[k] = vy[k] = vz[k] = E(0.0);

  Motion<E> motion = base_motion<E>(model);
  for (int i = 0; i < n; ++i) {
    const JointFrame& frame = model.frame(i);
    const E qi = prismatic ? coefficient<S>(q, i, pass) : E(0.0);
    const Vector3<E> p = origin<prismatic>(frame, qi);
    motion = step<prismatic>(frame, motion, c[i], s[i], qi, coefficient<S>(dq, i, pass),
                             coefficient<S>(ddq, i, pass));
    Vector3<E> om = motion.omega, al = motion.alpha, a = motion.a;
    Spin<E> L = motion.spin;
    const Eigen::Matrix3d& axes = model.axes(i);
    if (!model.frames_are_links()) {
      om = turned(axes, om), al = turned(axes, al), a = turned(axes, a);
      L = Spin<E>(om, al);
    }
    const V cv(c[i]), sv(s[i]), ca(frame.ca), sa(frame.sa);
    const Vector3<V> pv = {V(p.x), V(p.y), V(p.z)};
    const Vector3<V> omv = {V(om.x), V(om.y), V(om.z)}, alv = {V(al.x), V(al.y), V(al.z)};
    const Vector3<V> av = {V(a.x), V(a.y), V(a.z)};
    for (int g = 0; g < groups; ++g) {
      const int first = first_of_group<lanes>(g, n), at = g * lanes;
      if (first > i) {
        for (int k = 0; k < 10; ++k) write_rows<S>(out, first, 10 * i + k, pass, V(0.0));
        continue;
      }
      Vector3<V> w = {load<V>(wx + at), load<V>(wy + at), load<V>(wz + at)};
      Vector3<V> v = {load<V>(vx + at), load<V>(vy + at), load<V>(vz + at)};
      v = to_link(sum(v, cross(w, pv)), ca, sa, cv, sv);
      w = to_link(w, ca, sa, cv, sv);
      if (i < first + lanes) {
        const V unit = unit_lane<V, E>(first, i);
        if constexpr (prismatic) {
          w.z += unit * V(frame.revolute);
          v.z += unit * V(1.0 - frame.revolute);
        } else {
          w.z += unit;
        }
      }
      store(wx + at, w.x), store(wy + at, w.y), store(wz + at, w.z);
      store(vx + at, v.x), store(vy + at, v.y), store(vz + at, v.z);
      if (!model.frames_are_links()) w = turned(axes, w), v = turned(axes, v);

      const Vector3<V> aw = cross(av, w), u = cross(w, omv);
      const int column = 10 * i;
      write_rows<S>(out, first, column, pass, V(dot(v, av)));
      write_rows<S>(out, first, column + 1, pass, V(aw.x + v.x * V(L.xx) + v.y * V(L.yx) + v.z * V(L.zx)));
      write_rows<S>(out, first, column + 2, pass, V(aw.y + v.x * V(L.xy) + v.y * V(L.yy) + v.z * V(L.zy)));
      write_rows<S>(out, first, column + 3, pass, V(aw.z + v.x * V(L.xz) + v.y * V(L.yz) + v.z * V(L.zz)));
      write_rows<S>(out, first, column + 4, pass, V(w.x * alv.x + u.x * omv.x));
      write_rows<S>(out, first, column + 5, pass, V(w.x * alv.y + w.y * alv.x + u.x * omv.y + u.y * omv.x));
      write_rows<S>(out, first, column + 6, pass, V(w.y * alv.y + u.y * omv.y));
      write_rows<S>(out, first, column + 7, pass, V(w.x * alv.z + w.z * alv.x + u.x * omv.z + u.z * omv.x));
      write_rows<S>(out, first, column + 8, pass, V(w.y * alv.z + w.z * alv.y + u.y * omv.z + u.z * omv.y));
      write_rows<S>(out, first, column + 9, pass, V(w.z * alv.z + u.z * omv.z));
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
