// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

/// Joint i turns the links from i on, and S^T dq is the derivative of the kinetic energy by q: turning those
/// links about the axis s_i is the same as turning the velocity V_i that they ride on the other way, so that
///   p_i = s_i . h_i,   (S^T dq)_i = (V_i x s_i) . h_i,
/// h_i the momentum of the links from i on and V_i the twist of link i, about the origin of link i.
template <bool prismatic, int N, class S, class Q, class V, class P, class U>
[[gnu::always_inline]] inline void momentum(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                            const V& dq, P& p, U& rate, int pass) {
  using E = ElementOf<S>;
  const int n = model.size();
  E *const c = ws.row(0), *const s = ws.row(1);
  joint_rotations<S>(model, q, pass, c, s);

  const E zero(0.0);
  Vector3<E> omega = {zero, zero, zero}, v = omega, a = base_motion<E>(model).a;
  for (int i = 0; i < n; ++i) {
    const JointFrame& f = model.frame(i);
    const E qi = prismatic ? coefficient<S>(q, i, pass) : zero, speed = coefficient<S>(dq, i, pass);
    v = to_link(sum(v, cross(omega, origin<prismatic>(f, qi))), f.ca, f.sa, c[i], s[i]);
    omega = to_link(omega, f.ca, f.sa, c[i], s[i]);
    a = to_link(a, f.ca, f.sa, c[i], s[i]);
    omega.z += prismatic ? E(speed * f.revolute) : speed;
    if constexpr (prismatic) v.z += speed * (1.0 - f.revolute);
    E* const rows[9] = {ws.row(2), ws.row(3), ws.row(4), ws.row(5), ws.row(6),
                        ws.row(7), ws.row(8), ws.row(9), ws.row(10)};
    rows[0][i] = omega.x, rows[1][i] = omega.y, rows[2][i] = omega.z;
    rows[3][i] = v.x, rows[4][i] = v.y, rows[5][i] = v.z;
    rows[6][i] = a.x, rows[7][i] = a.y, rows[8][i] = a.z;
  }
  // Inwards: momentum, mass and first moment of the links from i on.
  Wrench<E> h = {{zero, zero, zero}, {zero, zero, zero}};
  Vector3<E> first = {zero, zero, zero};
  E mass = zero;
  for (int i = n - 1; i >= 0; --i) {
    const JointFrame& f = model.frame(i);
    const LinkMoments& k = model.reduced(i);
    const Vector3<E> w = {ws.row(2)[i], ws.row(3)[i], ws.row(4)[i]};
    const Vector3<E> u = {ws.row(5)[i], ws.row(6)[i], ws.row(7)[i]};
    const E ax = ws.row(8)[i], ay = ws.row(9)[i], az = ws.row(10)[i];
    const Vector3<E> moment = {E(k.hx), E(k.hy), E(k.hz)};
    const Vector3<E> wh = cross(w, moment), hu = cross(moment, u);
    h.f = sum(h.f, wh);
    if constexpr (prismatic) h.f = sum(h.f, k.m, u), mass += E(k.m);
    h.n.x += hu.x + w.x * (k.yy + k.zz) - w.y * k.xy - w.z * k.xz;
    h.n.y += hu.y + w.y * (k.xx + k.zz) - w.x * k.xy - w.z * k.yz;
    h.n.z += hu.z + w.z * (k.xx + k.yy) - w.x * k.xz - w.y * k.yz;
    first = sum(first, moment);

    const E weight = first.x * ay - first.y * ax, turning = h.n.x * w.y - h.n.y * w.x;
    const E sliding = h.f.x * u.y - h.f.y * u.x;
    if constexpr (prismatic) {
      const double r = f.revolute, t = 1.0 - r;
      Element<S>::put(p.coeffRef(i), pass, E(h.n.z * r + h.f.z * t));
      Element<S>::put(rate.coeffRef(i), pass,
                      E((turning + sliding - weight) * r + (h.f.x * w.y - h.f.y * w.x - mass * az) * t));
    } else {
      Element<S>::put(p.coeffRef(i), pass, h.n.z);
      Element<S>::put(rate.coeffRef(i), pass, E(turning + sliding - weight));
    }
    const Vector3<E> at = origin<prismatic>(f, prismatic ? coefficient<S>(q, i, pass) : zero);
    h = to_parent(h, f, at, c[i], s[i]);
    first = to_parent(first, f.ca, f.sa, c[i], s[i]);
    if constexpr (prismatic) first = sum(first, mass, at);
  }
}

}  // namespace detail

/// Generalised momentum of the rigid body and what changes it from within:
///   p = M(q) dq,   rate = S(q, dq)^T dq - g(q),   so that dp/dt = rate + (joint torque without friction).
/// One pass out and one back; neither M nor S is formed.
///
/// q [rad or m], dq: n, joints base to tip, any Eigen column expression of `Scalar`. p [kg m^2/s or kg m/s],
/// rate [N m or N]: n, written; any writable Eigen column vectors, already of size n. Inputs are not checked.
/// Neither allocates nor throws.
template <int N, class Scalar, class Q, class V, class P, class U>
void momentum(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
              const Eigen::MatrixBase<V>& dq, P&& p, U&& rate) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size());
  eigen_assert(p.size() == model.size() && rate.size() == model.size());
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    if (model.has_prismatic())
      detail::momentum<true>(model, ws, q.derived(), dq.derived(), p, rate, pass);
    else
      detail::momentum<false>(model, ws, q.derived(), dq.derived(), p, rate, pass);
  }
}

}  // namespace dynid
