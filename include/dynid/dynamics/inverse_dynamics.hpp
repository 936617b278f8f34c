// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

template <bool prismatic, int N, class S, class Q, class V, class A, class T>
[[gnu::always_inline]] inline void inverse_dynamics(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                                    const V& dq, const A& ddq, T& tau, int pass) {
  using E = ElementOf<S>;
  const int n = model.size();
  E *const c = ws.row(0), *const s = ws.row(1);
  E* const f[3] = {ws.row(2), ws.row(3), ws.row(4)};
  E* const m[3] = {ws.row(5), ws.row(6), ws.row(7)};
  joint_rotations<S>(model, q, pass, c, s);

  Motion<E> motion = base_motion<E>(model);
  Wrench<E> w{};
  int i = 0;
  if constexpr (!prismatic) {
    motion = first_step(motion, c[0], s[0], coefficient<S>(dq, 0, pass), coefficient<S>(ddq, 0, pass));
    const LinkMoments& k = model.reduced(0);
    w.n.z = motion.a.y * k.hx - motion.a.x * k.hy + motion.alpha.z * (k.xx + k.yy);
    m[2][0] = w.n.z;
    i = 1;
  }
  for (; i < n; ++i) {
    const E qi = prismatic ? coefficient<S>(q, i, pass) : E(0.0);
    motion = step<prismatic>(model.frame(i), motion, c[i], s[i], qi, coefficient<S>(dq, i, pass),
                             coefficient<S>(ddq, i, pass));
    w = link_wrench<!prismatic>(model.reduced(i), motion);
    f[0][i] = w.f.x, f[1][i] = w.f.y, f[2][i] = w.f.z;
    m[0][i] = w.n.x, m[1][i] = w.n.y, m[2][i] = w.n.z;
  }
  // Inwards, with w the wrench that joint i passes on.
  for (i = n - 1; i > 0; --i) {
    const JointFrame& frame = model.frame(i);
    E torque = w.n.z;
    if constexpr (prismatic) torque = w.n.z * frame.revolute + w.f.z * (1.0 - frame.revolute);
    Element<S>::put(tau.coeffRef(i), pass, torque);
    if constexpr (prismatic) {
      w = to_parent(w, frame, origin<true>(frame, coefficient<S>(q, i, pass)), c[i], s[i]);
    } else {
      w.f = to_parent(w.f, frame.ca, frame.sa, c[i], s[i]);
      w.n = to_parent(w.n, frame.ca, frame.sa, c[i], s[i]);
      w.n.x += w.f.z * frame.py - w.f.y * frame.pz;
      w.n.y += w.f.x * frame.pz - w.f.z * frame.px;
      w.n.z += w.f.y * frame.px - w.f.x * frame.py;
      if (i == 1) {
        w.n.z += m[2][0];
        break;
      }
    }
    w.f = sum(w.f, {f[0][i - 1], f[1][i - 1], f[2][i - 1]});
    w.n = sum(w.n, {m[0][i - 1], m[1][i - 1], m[2][i - 1]});
  }
  const double revolute = model.frame(0).revolute;
  Element<S>::put(tau.coeffRef(0), pass, prismatic ? E(w.n.z * revolute + w.f.z * (1.0 - revolute)) : w.n.z);
}

}  // namespace detail

/// Joint torques of the rigid body, M(q) ddq + S(q, dq) dq + g(q): recursive Newton-Euler, gravity included,
/// friction and rotor inertia not.
///
/// q [rad or m], dq, ddq: n, joints base to tip, any Eigen column expression of `Scalar` (a coefficient is
/// read once). tau [N m or N]: n, written; any writable Eigen column vector, already of size n. Inputs are
/// not checked. Neither allocates nor throws.
template <int N, class Scalar, class Q, class V, class A, class Tau>
void inverse_dynamics(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                      const Eigen::MatrixBase<V>& dq, const Eigen::MatrixBase<A>& ddq, Tau&& tau) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size() && ddq.size() == model.size());
  eigen_assert(tau.size() == model.size());
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    if (model.has_prismatic())
      detail::inverse_dynamics<true>(model, ws, q.derived(), dq.derived(), ddq.derived(), tau, pass);
    else
      detail::inverse_dynamics<false>(model, ws, q.derived(), dq.derived(), ddq.derived(), tau, pass);
  }
}

}  // namespace dynid
