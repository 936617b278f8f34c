// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sincos.hpp"
#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/packet.hpp"

namespace dynid::detail {

/// Sample `pass` of coefficient i of a vector whose scalar is S.
template <class S, class Q>
[[gnu::always_inline]] inline ElementOf<S> coefficient(const Q& q, int i, int pass) {
  static_assert(std::is_same_v<typename Q::Scalar, S>, "the vector and the workspace must have one scalar");
  return Element<S>::get(q.coeff(i), pass);
}

/// A vector of zeros.
struct Zeros {
  using Scalar = void;
};
template <class S>
[[gnu::always_inline]] inline ElementOf<S> coefficient(const Zeros&, int, int) {
  return ElementOf<S>(0.0);
}

/// Neighbours first, first + 1... of a vector of doubles.
template <class V, class Q>
[[gnu::always_inline]] inline V neighbours(const Q& q, int first) {
  if constexpr ((int(Q::Flags) & Eigen::DirectAccessBit) && Q::InnerStrideAtCompileTime == 1) {
    return V::load(q.data() + first);
  } else {
    double values[lane_width];
    for (int k = 0; k < lane_width; ++k) values[k] = q.coeff(first + k);
    return V::load(values);
  }
}

/// First joint of lane group g of n joints, n >= width. The last group ends at joint n - 1 and overlaps the
/// one before it rather than run past the end.
template <int width>
constexpr int first_of_group(int g, int n) {
  return g * width < n - width ? g * width : n - width;
}

/// Calls f(V(), E()) with the lane type to use for n joints: fewer joints than lanes are done one at a time.
template <class E, int N, class F>
[[gnu::always_inline]] inline void with_lanes(const Model<N>& model, const F& f) {
  using V = typename JointLane<E>::Type;
  if constexpr (std::is_same_v<V, E> || (N != Eigen::Dynamic && N < width<V, E>)) {
    f(E());
  } else {
    if (N != Eigen::Dynamic || model.size() >= width<V, E>) return f(V());
    if constexpr (N == Eigen::Dynamic) f(E());
  }
}

/// c[i], s[i] = cos, sin of theta_i + q_i; of theta_i alone for a prismatic joint.
template <class S, int N, class Q>
[[gnu::always_inline]] inline void joint_rotations(const Model<N>& model, const Q& q, int pass,
                                                   ElementOf<S>* c, ElementOf<S>* s) {
  using E = ElementOf<S>;
  const int n = model.size();
  with_lanes<E>(model, [&](auto lane) {
    using V = decltype(lane);
    constexpr int w = width<V, E>;
    for (int g = 0; g * w < n; ++g) {
      const int first = first_of_group<w>(g, n);
      V angle;
      if constexpr (w == 1)
        angle = coefficient<S>(q, first, pass);
      else
        angle = neighbours<V>(q, first);
      if (model.has_prismatic()) angle *= load_constant<V, E>(model.revolute() + first);
      angle += load_constant<V, E>(model.theta() + first);
      V sine, cosine;
      sincos(angle, sine, cosine);
      store(s + first, sine);
      store(c + first, cosine);
    }
  });
}

/// A vector, and the rotations Rx(alpha) Rz(theta + q) of one joint.
template <class V>
struct Vector3 {
  V x, y, z;
};

/// (Rx Rz)^T a: from the frame of the link before to the link's own.
template <class V, class A, class C>
[[gnu::always_inline]] inline Vector3<V> to_link(const Vector3<V>& a, const A& ca, const A& sa, const C& c,
                                                 const C& s) {
  const V y = a.y * ca + a.z * sa;
  const V z = a.z * ca - a.y * sa;
  return {V(a.x * c + y * s), V(y * c - a.x * s), z};
}

/// Rx Rz a: back to the link before.
template <class V, class A, class C>
[[gnu::always_inline]] inline Vector3<V> to_parent(const Vector3<V>& a, const A& ca, const A& sa, const C& c,
                                                   const C& s) {
  const V x = a.x * c - a.y * s;
  const V y = a.x * s + a.y * c;
  return {x, V(y * ca - a.z * sa), V(y * sa + a.z * ca)};
}

template <class V>
[[gnu::always_inline]] inline Vector3<V> cross(const Vector3<V>& a, const Vector3<V>& b) {
  return {V(a.y * b.z - a.z * b.y), V(a.z * b.x - a.x * b.z), V(a.x * b.y - a.y * b.x)};
}
template <class V>
[[gnu::always_inline]] inline V dot(const Vector3<V>& a, const Vector3<V>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
[[gnu::always_inline]] inline Vector3<V> sum(const Vector3<V>& a, const Vector3<V>& b) {
  return {V(a.x + b.x), V(a.y + b.y), V(a.z + b.z)};
}
/// a + k b
template <class V, class K>
[[gnu::always_inline]] inline Vector3<V> sum(const Vector3<V>& a, const K& k, const Vector3<V>& b) {
  return {V(a.x + b.x * k), V(a.y + b.y * k), V(a.z + b.z * k)};
}

/// L = S(alpha) + S(omega)^2: a point fixed in the link at r accelerates by L r relative to the origin.
template <class V>
struct Spin {
  V xx, xy, xz, yx, yy, yz, zx, zy, zz;
  Spin() = default;
  [[gnu::always_inline]] Spin(const Vector3<V>& w, const Vector3<V>& al) {
    const V x2 = w.x * w.x, y2 = w.y * w.y, z2 = w.z * w.z;
    xx = -(y2 + z2);
    yy = -(x2 + z2);
    zz = -(x2 + y2);
    xy = w.x * w.y - al.z;
    yx = w.x * w.y + al.z;
    xz = w.x * w.z + al.y;
    zx = w.x * w.z - al.y;
    yz = w.y * w.z - al.x;
    zy = w.y * w.z + al.x;
  }
  /// a + L (x, y, z)
  template <class K>
  [[gnu::always_inline]] Vector3<V> plus(const Vector3<V>& a, const K& x, const K& y, const K& z) const {
    return {V(a.x + xx * x + xy * y + xz * z), V(a.y + yx * x + yy * y + yz * z),
            V(a.z + zx * x + zy * y + zz * z)};
  }
};

}  // namespace dynid::detail
