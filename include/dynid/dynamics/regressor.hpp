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

/// The wrench that moving a link takes, parameter by parameter. m: the force a. First moments: the force L
/// e_k, the column here, and the couple e_k x a. Inertia: the couple J alpha + omega x J omega.
template <class V>
struct LinkColumns {
  Vector3<V> a, hx, hy, hz, xx, xy, yy, xz, yz, zz;
  [[gnu::always_inline]] explicit LinkColumns(const Motion<V>& m) {
    const Vector3<V>&w = m.omega, &alpha = m.alpha;
    const Spin<V>& L = m.spin;
    const V x2 = w.x * w.x, y2 = w.y * w.y, z2 = w.z * w.z, x_y = w.x * w.y, x_z = w.x * w.z, y_z = w.y * w.z;
    a = m.a;
    hx = {L.xx, L.yx, L.zx}, hy = {L.xy, L.yy, L.zy}, hz = {L.xz, L.yz, L.zz};
    xx = {alpha.x, x_z, V(-x_y)}, yy = {V(-y_z), alpha.y, x_y}, zz = {y_z, V(-x_z), alpha.z};
    xy = {V(-L.zx), L.zy, V(x2 - y2)}, xz = {L.yx, V(z2 - x2), V(-L.yz)}, yz = {V(y2 - z2), V(-L.xy), L.xz};
  }
};

/// Each joint's unit twist is carried outwards, link by link (lanes are joints), and the power it does on a
/// link moving as that link does is read off, parameter by parameter.
template <bool prismatic, class V, int N, class S, class Q, class D, class A, class Y>
[[gnu::always_inline]] inline void regressor(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                             const D& dq, const A& ddq, Y& out, int pass) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int n = model.size();
  const bool turn = !model.frames_are_links();
  E *const c = ws.row(0), *const s = ws.row(1);
  const Rows3<E> rw(ws, 2), rv(ws, 5);  // twists in the current link's frame, group g's at g * lanes
  joint_rotations<S>(model, q, pass, c, s);

  const V zero(0.0);
  Motion<V> motion = base_motion<V>(model);  // the same in every lane
  for (int i = 0; i < n; ++i) {
    const JointFrame& frame = model.frame(i);
    const V ci(c[i]), si(s[i]), qi = prismatic ? V(coefficient<S>(q, i, pass)) : zero;
    const V dqi(coefficient<S>(dq, i, pass)), ddqi(coefficient<S>(ddq, i, pass));
    motion = prismatic || i > 0 ? step<prismatic>(frame, motion, ci, si, qi, dqi, ddqi)
                                : first_step(motion, ci, si, dqi, ddqi);
    Motion<V> seen = motion;  // in the robot's link frame
    if (turn) {
      const Eigen::Matrix3d& axes = model.axes(i);
      seen.omega = turned(axes, motion.omega), seen.alpha = turned(axes, motion.alpha);
      seen.a = turned(axes, motion.a), seen.spin = Spin<V>(seen.omega, seen.alpha);
    }
    const LinkColumns<V> link(seen);
    const Vector3<V> p = origin<prismatic>(frame, qi);

    for (int g = 0; g * lanes < n; ++g) {
      const int first = first_of_group<lanes>(g, n), column = 10 * i;
      const auto write = [&](int k, const V& x) { write_rows<S>(out, first, column + k, pass, x); };
      if (i < first) {
        for (int k = 0; k < 10; ++k) write(k, zero);
        continue;
      }
      Vector3<V> w = {zero, zero, zero}, v = w;
      if (i > first) {  // nothing moves before
        w = rw.template get<V>(g * lanes), v = rv.template get<V>(g * lanes);
        v = to_link(sum(v, cross(w, p)), frame.ca, frame.sa, ci, si);
        w = to_link(w, frame.ca, frame.sa, ci, si);
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
      rw.set(g * lanes, w), rv.set(g * lanes, v);
      if (!prismatic && i == first && !turn) {  // a turn about z alone
        write(0, zero), write(1, w.z * link.a.y), write(2, -w.z * link.a.x), write(3, zero);
        write(4, w.z * link.xx.z), write(5, w.z * link.xy.z), write(6, w.z * link.yy.z);
        write(7, w.z * link.xz.z), write(8, w.z * link.yz.z), write(9, w.z * link.zz.z);
        continue;
      }
      if (turn) w = turned(model.axes(i), w), v = turned(model.axes(i), v);
      const Vector3<V> couple = cross(link.a, w);
      write(0, dot(v, link.a));
      write(1, couple.x + dot(v, link.hx));
      write(2, couple.y + dot(v, link.hy));
      write(3, couple.z + dot(v, link.hz));
      write(4, dot(w, link.xx)), write(5, dot(w, link.xy)), write(6, dot(w, link.yy));
      write(7, dot(w, link.xz)), write(8, dot(w, link.yz)), write(9, dot(w, link.zz));
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
