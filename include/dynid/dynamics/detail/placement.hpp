// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/detail/write.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid::detail {

// The mass and Coriolis matrices are worked out in one frame, internal frame 0, about one point, its origin:
// the moments of what a joint carries are then plain sums over links. Rows of the workspace, each over
// joints:
enum Row : int {
  row_c,
  row_s,
  row_x,  // axes of the link's internal frame
  row_y = row_x + 3,
  row_z = row_y + 3,
  row_p = row_z + 3,        // its origin
  row_w = row_p + 3,        // unit twist of the joint: angular
  row_v = row_w + 3,        // and linear, of the point at the origin of frame 0
  row_moments = row_v + 3,  // of the links from this one on: m, h (3), Sigma (xx xy yy xz yz zz)
  row_force =
      row_moments + 10,  // force and couple that take those links through the joint's unit acceleration
  row_couple = row_force + 3,
  row_free = row_couple + 3,
  row_axes = row_free,  // 16 numbers a joint, where a register holds an axis
};

/// Row k of a workspace's scratch, three at a time.
template <class E>
struct Rows3 {
  E *x, *y, *z;
  template <class Workspace>
  [[gnu::always_inline]] Rows3(Workspace& ws, int first)
      : x(ws.row(first)), y(ws.row(first + 1)), z(ws.row(first + 2)) {}
  template <class V>
  [[gnu::always_inline]] Vector3<V> get(int at) const {
    return {load<V>(x + at), load<V>(y + at), load<V>(z + at)};
  }
  template <class V>
  [[gnu::always_inline]] void set(int at, const Vector3<V>& a) const {
    store(x + at, a.x), store(y + at, a.y), store(z + at, a.z);
  }
  /// Element `at` for every lane.
  template <class V>
  [[gnu::always_inline]] Vector3<V> all(int at) const {
    return {V(x[at]), V(y[at]), V(z[at])};
  }
};

/// Axes and origins of the internal frames in internal frame 0, base to tip: rows row_x to row_p + 2. With
/// `from_first` in that of the first joint.
template <class S, bool from_first = false, int N, class Q>
[[gnu::always_inline]] inline void place(const Model<N>& model, Workspace<N, S>& ws, const Q& q, int pass) {
  using E = ElementOf<S>;
  const int n = model.size();
  E *const c = ws.row(row_c), *const s = ws.row(row_s);
  const Rows3<E> rx(ws, row_x), ry(ws, row_y), rz(ws, row_z), rp(ws, row_p);
  joint_rotations<S>(model, q, pass, c, s);
  const E zero(0.0), one(1.0);
  Vector3<E> x = {one, zero, zero}, y = {zero, one, zero}, z = {zero, zero, one}, p = {zero, zero, zero};
  if (from_first) rx.set(0, x), ry.set(0, y), rz.set(0, z), rp.set(0, p);
  for (int i = from_first ? 1 : 0; i < n; ++i) {
    const JointFrame& f = model.frame(i);
    p = sum(sum(sum(p, f.px, x), f.py, y), f.pz, z);
    const Vector3<E> turned = {E(y.x * f.ca + z.x * f.sa), E(y.y * f.ca + z.y * f.sa),
                               E(y.z * f.ca + z.z * f.sa)};
    z = {E(z.x * f.ca - y.x * f.sa), E(z.y * f.ca - y.y * f.sa), E(z.z * f.ca - y.z * f.sa)};
    y = {E(turned.x * c[i] - x.x * s[i]), E(turned.y * c[i] - x.y * s[i]), E(turned.z * c[i] - x.z * s[i])};
    x = {E(x.x * c[i] + turned.x * s[i]), E(x.y * c[i] + turned.y * s[i]), E(x.z * c[i] + turned.z * s[i])};
    if (model.has_prismatic()) p = sum(p, E(coefficient<S>(q, i, pass) * (1.0 - f.revolute)), z);
    rx.set(i, x), ry.set(i, y), rz.set(i, z), rp.set(i, p);
  }
}

/// Angular and linear part of a joint's unit twist.
template <class V>
struct Twist {
  Vector3<V> w, v;
};

/// Unit twists of the joints at `at`, whose axes are z through p.
template <bool prismatic, class V, class E, int N>
[[gnu::always_inline]] inline Twist<V> unit_twists(const Model<N>& model, int at, const Vector3<V>& z,
                                                   const Vector3<V>& p) {
  const Vector3<V> v = cross(p, z);
  if constexpr (prismatic) {
    const V turn = load_constant<V, E>(model.revolute() + at), slide = V(1.0) - turn;
    return {{V(z.x * turn), V(z.y * turn), V(z.z * turn)},
            {V(v.x * turn + z.x * slide), V(v.y * turn + z.y * slide), V(v.z * turn + z.z * slide)}};
  } else {
    return {z, v};
  }
}
/// Of all joints, after place(): rows row_w to row_v + 2.
template <class V, int N, class S>
[[gnu::always_inline]] inline void place_twists(const Model<N>& model, Workspace<N, S>& ws) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int n = model.size();
  const Rows3<E> rz(ws, row_z), rp(ws, row_p), rw(ws, row_w), rv(ws, row_v);
  for (int g = 0; g * lanes < n; ++g) {
    const int at = first_of_group<lanes>(g, n);
    const Vector3<V> z = rz.template get<V>(at), p = rp.template get<V>(at);
    const auto [w, v] = model.has_prismatic() ? unit_twists<true, V, E>(model, at, z, p)
                                              : unit_twists<false, V, E>(model, at, z, p);
    rw.set(at, w), rv.set(at, v);
  }
}

#if defined(__GNUC__) && defined(__AVX__)
template <class V, class E>
inline constexpr bool axes_in_registers = std::is_same_v<E, double> && (width<V, E> == 4);
#else
template <class V, class E>
inline constexpr bool axes_in_registers = false;
#endif

/// Axes and origins of the internal frames in that of the first joint, for placed_group(). Where a register
/// holds an axis, a joint's four vectors are stored one after the other from row_axes on: loads of groups
/// would have to wait for components stored one by one.
template <bool prismatic, class S, class V, int N, class Q>
[[gnu::always_inline]] inline void place_groups(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                                int pass) {
  using E = ElementOf<S>;
  if constexpr (!axes_in_registers<V, E>) {
    place<S, true>(model, ws, q, pass);
  } else {
    const int n = model.size();
    E *const c = ws.row(row_c), *const s = ws.row(row_s), *const axes = ws.row(row_axes);
    joint_rotations<S>(model, q, pass, c, s);
    using Vector = typename V::Vector;
    V x(Vector{1, 0, 0, 0}), y(Vector{0, 1, 0, 0}), z(Vector{0, 0, 1, 0}), p(Vector{});
#pragma GCC unroll 8
    for (int i = 0; i < n; ++i) {
      if (i > 0) {
        const JointFrame& frame = model.frame(i);
        const V ca(frame.ca), sa(frame.sa), cosine(c[i]), sine(s[i]);
        p = p + x * V(frame.px) + y * V(frame.py) + z * V(frame.pz);
        const V turned = y * ca + z * sa;
        z = z * ca - y * sa;
        y = turned * cosine - x * sine;
        x = x * cosine + turned * sine;
        if constexpr (prismatic) p = p + z * V(coefficient<S>(q, i, pass) * (1.0 - frame.revolute));
      }
      store(axes + 16 * i, x), store(axes + 16 * i + 4, y), store(axes + 16 * i + 8, z);
      store(axes + 16 * i + 12, p);
    }
  }
}

/// Axes and origins of a group of joints.
template <class V>
struct Placed {
  Vector3<V> x, y, z, p;
};

/// Of the joints at `at`, after place_groups().
template <class S, class V, int N>
[[gnu::always_inline]] inline Placed<V> placed_group(Workspace<N, S>& ws, int at) {
  using E = ElementOf<S>;
  if constexpr (!axes_in_registers<V, E>) {
    return {Rows3<E>(ws, row_x).template get<V>(at), Rows3<E>(ws, row_y).template get<V>(at),
            Rows3<E>(ws, row_z).template get<V>(at), Rows3<E>(ws, row_p).template get<V>(at)};
  } else {
    const E* const axes = ws.row(row_axes) + 16 * at;
    const auto turned = [&](int k) {
      Vector3<V> a;
      transpose(load<V>(axes + k), load<V>(axes + k + 16), load<V>(axes + k + 32), load<V>(axes + k + 48),
                a.x, a.y, a.z);
      return a;
    };
    return {turned(0), turned(4), turned(8), turned(12)};
  }
}

/// Mass, first moment and second moment about the origin of frame 0.
template <class V>
struct Moments {
  V m;
  Vector3<V> h;
  V xx, xy, yy, xz, yz, zz;

  /// f(a, b) for each of these and the same of `other`; the mass is left out where it is nil.
  template <bool mass, class F>
  [[gnu::always_inline]] void for_each(Moments& other, const F& f) {
    if constexpr (mass) f(m, other.m);
    f(h.x, other.h.x), f(h.y, other.h.y), f(h.z, other.h.z);
    f(xx, other.xx), f(xy, other.xy), f(yy, other.yy);
    f(xz, other.xz), f(yz, other.yz), f(zz, other.zz);
  }
};

/// Reduced moments of the links at `at`, placed. Without prismatic joints the mass is nil.
template <bool prismatic, class V, class E, int N>
[[gnu::always_inline]] inline Moments<V> placed_moments(const Model<N>& model, int at,
                                                        const Placed<V>& placed) {
  const auto constant = [&](int k) { return load_constant<V, E>(model.reduced_row(k) + at); };
  const Vector3<V>&x = placed.x, &y = placed.y, &z = placed.z, &p = placed.p;
  const V hx = constant(1), hy = constant(2);
  const V xx = constant(4), xy = constant(5), yy = constant(6), xz = constant(7), yz = constant(8);
  Moments<V> r;
  // R Sigma R^T = t1 x^T + t2 y^T + t3 z^T, R h; then about the origin of frame 0.
  const auto combine = [&](const V& a, const V& b, const V& c) {
    return Vector3<V>{V(x.x * a + y.x * b + z.x * c), V(x.y * a + y.y * b + z.y * c),
                      V(x.z * a + y.z * b + z.z * c)};
  };
  const Vector3<V> t1 = combine(xx, xy, xz), t2 = combine(xy, yy, yz);
  Vector3<V> t3, h;
  if constexpr (prismatic) {
    t3 = combine(xz, yz, constant(9));
    h = combine(hx, hy, constant(3));
    r.m = constant(0);
    r.h = sum(h, r.m, p);
  } else {
    t3 = {V(x.x * xz + y.x * yz), V(x.y * xz + y.y * yz), V(x.z * xz + y.z * yz)};
    h = {V(x.x * hx + y.x * hy), V(x.y * hx + y.y * hy), V(x.z * hx + y.z * hy)};
    r.m = V(0.0);
    r.h = h;
  }
  const auto entry = [&](const V& t1a, const V& t2a, const V& t3a, const V& xb, const V& yb, const V& zb,
                         const V& pa, const V& pb, const V& ha,
                         const V& hb) { return V(t1a * xb + t2a * yb + t3a * zb + pa * hb + ha * pb); };
  r.xx = entry(t1.x, t2.x, t3.x, x.x, y.x, z.x, p.x, p.x, h.x, r.h.x);
  r.xy = entry(t1.x, t2.x, t3.x, x.y, y.y, z.y, p.x, p.y, h.x, r.h.y);
  r.yy = entry(t1.y, t2.y, t3.y, x.y, y.y, z.y, p.y, p.y, h.y, r.h.y);
  r.xz = entry(t1.x, t2.x, t3.x, x.z, y.z, z.z, p.x, p.z, h.x, r.h.z);
  r.yz = entry(t1.y, t2.y, t3.y, x.z, y.z, z.z, p.y, p.z, h.y, r.h.z);
  r.zz = entry(t1.z, t2.z, t3.z, x.z, y.z, z.z, p.z, p.z, h.z, r.h.z);
  return r;
}

/// The same after place().
template <bool prismatic, class V, int N, class S>
[[gnu::always_inline]] inline Moments<V> placed_moments(const Model<N>& model, Workspace<N, S>& ws, int at) {
  using E = ElementOf<S>;
  return placed_moments<prismatic, V, E>(
      model, at,
      Placed<V>{Rows3<E>(ws, row_x).template get<V>(at), Rows3<E>(ws, row_y).template get<V>(at),
                Rows3<E>(ws, row_z).template get<V>(at), Rows3<E>(ws, row_p).template get<V>(at)});
}

/// Rows first ... first + count - 1 become, joint by joint, their sums over the links from that joint on.
/// These rows hold group g's lanes at g * width: groups overlap in joints, not in storage. Of joints in two
/// groups the last group's lanes count, the others' are undefined.
template <class V, int N, class S>
[[gnu::always_inline]] inline void sum_inwards(Workspace<N, S>& ws, int n, int first, int count) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int last = (n - 1) / lanes;
  for (int k = first; k < first + count; ++k) {
    E* const row = ws.row(k);
    V x = sum_of_later<V, E>(load<V>(row + last * lanes));
    store(row + last * lanes, x);
    for (int g = last - 1; g >= 0; --g) {
      const int next = first_of_group<lanes>(g + 1, n);
      x = select_up_to<V, E>(first_of_group<lanes>(g, n), next - 1, load<V>(row + g * lanes), V(0.0));
      x = sum_of_later<V, E>(x) + V(row[(g + 1) * lanes]);
      store(row + g * lanes, x);
    }
  }
}

template <class V, int N, class S>
[[gnu::always_inline]] inline void set_moments(Workspace<N, S>& ws, int slot, const Moments<V>& k) {
  const V values[10] = {k.m, k.h.x, k.h.y, k.h.z, k.xx, k.xy, k.yy, k.xz, k.yz, k.zz};
  for (int i = 0; i < 10; ++i) store(ws.row(row_moments + i) + slot, values[i]);
}
template <class V, int N, class S>
[[gnu::always_inline]] inline Moments<V> get_moments(Workspace<N, S>& ws, int slot) {
  const auto get = [&](int i) { return load<V>(ws.row(row_moments + i) + slot); };
  return {get(0), {get(1), get(2), get(3)}, get(4), get(5), get(6), get(7), get(8), get(9)};
}

/// Force and couple of a body of moments k that accelerates from rest as the twist (w, v): I S.
template <bool prismatic, class V>
[[gnu::always_inline]] inline Wrench<V> inertia_times(const Moments<V>& k, const Vector3<V>& w,
                                                      const Vector3<V>& v) {
  Wrench<V> r;
  r.f = cross(w, k.h);
  if constexpr (prismatic) r.f = sum(r.f, k.m, v);
  const Vector3<V> hv = cross(k.h, v);
  r.n.x = hv.x + (k.yy + k.zz) * w.x - k.xy * w.y - k.xz * w.z;
  r.n.y = hv.y + (k.xx + k.zz) * w.y - k.xy * w.x - k.yz * w.z;
  r.n.z = hv.z + (k.xx + k.yy) * w.z - k.xz * w.x - k.yz * w.y;
  return r;
}

}  // namespace dynid::detail
