// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/rotations.hpp"

namespace dynid::detail {

/// Motion of one link, in its internal frame: angular velocity and acceleration, and the acceleration of the
/// origin less gravity [rad/s, rad/s^2, m/s^2].
template <class E>
struct Motion {
  Vector3<E> omega, alpha, a;
  Spin<E> spin;
};

/// The acceleration of the base that stands for gravity.
template <class E, int N>
[[gnu::always_inline]] inline Motion<E> base_motion(const Model<N>& model) {
  const Eigen::Vector3d& g = model.base_gravity();
  const E zero(0.0);
  Motion<E> b;
  b.omega = b.alpha = {zero, zero, zero};
  b.a = {E(-g.x()), E(-g.y()), E(-g.z())};
  b.spin = Spin<E>(b.omega, b.alpha);
  return b;
}

/// Origin of a link's frame in that of the link before.
template <bool prismatic, class E>
[[gnu::always_inline]] inline Vector3<E> origin(const JointFrame& f, const E& q) {
  if constexpr (prismatic) {
    const E slide = q * (1.0 - f.revolute);
    return {E(f.px), E(f.py - slide * f.sa), E(f.pz + slide * f.ca)};
  } else {
    return {E(f.px), E(f.py), E(f.pz)};
  }
}

/// One step of the outward recursion. `prismatic`: the chain has prismatic joints.
template <bool prismatic, class E>
[[gnu::always_inline]] inline Motion<E> step(const JointFrame& f, const Motion<E>& m, const E& c, const E& s,
                                             const E& q, const E& dq, const E& ddq) {
  Motion<E> r;
  r.omega = to_link(m.omega, f.ca, f.sa, c, s);
  r.alpha = to_link(m.alpha, f.ca, f.sa, c, s);
  if constexpr (prismatic) {
    const Vector3<E> p = origin<true>(f, q);
    r.a = to_link(m.spin.plus(m.a, p.x, p.y, p.z), f.ca, f.sa, c, s);
    const E turn = dq * f.revolute, slide = dq - turn;
    r.a.x += 2.0 * r.omega.y * slide;
    r.a.y -= 2.0 * r.omega.x * slide;
    r.a.z += ddq * (1.0 - f.revolute);
    r.alpha.x += r.omega.y * turn;
    r.alpha.y -= r.omega.x * turn;
    r.alpha.z += ddq * f.revolute;
    r.omega.z += turn;
  } else {
    r.a = to_link(m.spin.plus(m.a, f.px, f.py, f.pz), f.ca, f.sa, c, s);
    r.alpha.x += r.omega.y * dq;
    r.alpha.y -= r.omega.x * dq;
    r.alpha.z += ddq;
    r.omega.z += dq;
  }
  r.spin = Spin<E>(r.omega, r.alpha);
  return r;
}

/// The first step for a revolute joint: the base is at rest and its frame is aligned with the axis.
template <class E>
[[gnu::always_inline]] inline Motion<E> first_step(const Motion<E>& base, const E& c, const E& s, const E& dq,
                                                   const E& ddq) {
  const E zero(0.0);
  Motion<E> r;
  r.omega = {zero, zero, dq};
  r.alpha = {zero, zero, ddq};
  r.a = {E(base.a.x * c + base.a.y * s), E(base.a.y * c - base.a.x * s), base.a.z};
  r.spin.xx = r.spin.yy = -(dq * dq);
  r.spin.xy = -ddq;
  r.spin.yx = ddq;
  r.spin.xz = r.spin.yz = r.spin.zx = r.spin.zy = r.spin.zz = zero;
  return r;
}

template <class E>
struct Wrench {
  Vector3<E> f, n;  ///< force [N], moment about the origin of the link's frame [N m]
};

/// What it takes to move a link as `m`: n = h x a + axial part of L Sigma - (L Sigma)^T.
/// `reduced`: the mass, h_z and Sigma_zz are zero and not read.
template <bool reduced, class E>
[[gnu::always_inline]] inline Wrench<E> link_wrench(const LinkMoments& k, const Motion<E>& m) {
  const Spin<E>& L = m.spin;
  Wrench<E> w;
  if constexpr (reduced) {
    w.f = {E(L.xx * k.hx + L.xy * k.hy), E(L.yx * k.hx + L.yy * k.hy), E(L.zx * k.hx + L.zy * k.hy)};
    w.n.x = m.a.z * k.hy + L.zx * k.xy + L.zy * k.yy + L.zz * k.yz - L.yx * k.xz - L.yy * k.yz;
    w.n.y = L.xx * k.xz + L.xy * k.yz - m.a.z * k.hx - L.zx * k.xx - L.zy * k.xy - L.zz * k.xz;
    w.n.z = m.a.y * k.hx - m.a.x * k.hy + L.yx * k.xx + L.yy * k.xy + L.yz * k.xz - L.xx * k.xy -
            L.xy * k.yy - L.xz * k.yz;
  } else {
    const Vector3<E> h = {E(k.hx), E(k.hy), E(k.hz)}, ha = cross(h, m.a);
    w.f = L.plus({E(m.a.x * k.m), E(m.a.y * k.m), E(m.a.z * k.m)}, k.hx, k.hy, k.hz);
    w.n.x = ha.x + (L.zx * k.xy + L.zy * k.yy + L.zz * k.yz) - (L.yx * k.xz + L.yy * k.yz + L.yz * k.zz);
    w.n.y = ha.y + (L.xx * k.xz + L.xy * k.yz + L.xz * k.zz) - (L.zx * k.xx + L.zy * k.xy + L.zz * k.xz);
    w.n.z = ha.z + (L.yx * k.xx + L.yy * k.xy + L.yz * k.xz) - (L.xx * k.xy + L.xy * k.yy + L.xz * k.yz);
  }
  return w;
}

/// A wrench on a link, seen from the link before it: turned, and moved to that link's origin.
template <class E>
[[gnu::always_inline]] inline Wrench<E> to_parent(const Wrench<E>& w, const JointFrame& f,
                                                  const Vector3<E>& p, const E& c, const E& s) {
  Wrench<E> r;
  r.f = to_parent(w.f, f.ca, f.sa, c, s);
  r.n = sum(to_parent(w.n, f.ca, f.sa, c, s), cross(p, r.f));
  return r;
}

}  // namespace dynid::detail
