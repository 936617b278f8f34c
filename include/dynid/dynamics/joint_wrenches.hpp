// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

/// The wrench that link i - 1 exerts on link i through joint i, gravity included.
///
/// q [rad or m], dq, ddq: n, joints base to tip, any Eigen column expression of `Scalar`. W: 6 x n, written
/// whole, any writable Eigen matrix of that size: column i holds the force [N] (rows 0-2) and the moment [N
/// m] (rows 3-5) about the origin of the robot's link frame i, in the axes of that frame. Its part along the
/// joint axis is inverse_dynamics(). Neither allocates nor throws.
template <int N, class Scalar, class Q, class V, class A, class Out>
void joint_wrenches(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                    const Eigen::MatrixBase<V>& dq, const Eigen::MatrixBase<A>& ddq, Out&& W) noexcept {
  using E = detail::ElementOf<Scalar>;
  using Lanes = detail::Element<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n && dq.size() == n && ddq.size() == n && W.rows() == 6 && W.cols() == n);
  E *const c = ws.row(0), *const s = ws.row(1);
  E* f[3] = {ws.row(2), ws.row(3), ws.row(4)};
  E* m[3] = {ws.row(5), ws.row(6), ws.row(7)};
  for (int pass = 0; pass < Lanes::passes; ++pass) {
    detail::joint_rotations<Scalar>(model, q.derived(), pass, c, s);
    detail::Motion<E> motion = detail::base_motion<E>(model);
    for (int i = 0; i < n; ++i) {
      motion = detail::step<true>(model.frame(i), motion, c[i], s[i],
                                  detail::coefficient<Scalar>(q.derived(), i, pass),
                                  detail::coefficient<Scalar>(dq.derived(), i, pass),
                                  detail::coefficient<Scalar>(ddq.derived(), i, pass));
      const detail::Wrench<E> w = detail::link_wrench<false>(model.moments(i), motion);
      f[0][i] = w.f.x, f[1][i] = w.f.y, f[2][i] = w.f.z;
      m[0][i] = w.n.x, m[1][i] = w.n.y, m[2][i] = w.n.z;
    }
    detail::Wrench<E> w = {{f[0][n - 1], f[1][n - 1], f[2][n - 1]}, {m[0][n - 1], m[1][n - 1], m[2][n - 1]}};
    for (int i = n - 1; i >= 0; --i) {
      const Eigen::Matrix3d& axes = model.axes(i);
      for (int k = 0; k < 3; ++k) {
        Lanes::put(W.coeffRef(k, i), pass, E(w.f.x * axes(k, 0) + w.f.y * axes(k, 1) + w.f.z * axes(k, 2)));
        Lanes::put(W.coeffRef(3 + k, i), pass,
                   E(w.n.x * axes(k, 0) + w.n.y * axes(k, 1) + w.n.z * axes(k, 2)));
      }
      if (i == 0) break;
      const detail::JointFrame& frame = model.frame(i);
      w = detail::to_parent(w, frame,
                            detail::origin<true>(frame, detail::coefficient<Scalar>(q.derived(), i, pass)),
                            c[i], s[i]);
      w.f = detail::sum(w.f, {f[0][i - 1], f[1][i - 1], f[2][i - 1]});
      w.n = detail::sum(w.n, {m[0][i - 1], m[1][i - 1], m[2][i - 1]});
    }
  }
}

}  // namespace dynid
