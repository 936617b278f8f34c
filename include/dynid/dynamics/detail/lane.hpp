// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

namespace dynid::detail {

#if defined(__GNUC__)  // GCC, Clang and their kin lower these vectors to whatever the target has

#if defined(__AVX__)
inline constexpr int lane_width = 4;
#else
inline constexpr int lane_width = 2;
#endif

/// `lane_width` doubles that fit one machine register; arithmetic is lane by lane.
struct Lane {
  using Vector [[gnu::vector_size(lane_width * sizeof(double))]] = double;
  using Bits [[gnu::vector_size(lane_width * sizeof(double))]] = std::int64_t;
  using UnalignedVector [[gnu::aligned(8), gnu::may_alias]] = Vector;

  Vector v;

  Lane() = default;
  // Not trivial: compilers copy trivial structures by half registers, for which loads of whole ones wait.
  // NOLINTBEGIN(modernize-use-equals-default, performance-unnecessary-value-param): all is inlined
  [[gnu::always_inline]] Lane(const Lane& other) : v(other.v) {}
  [[gnu::always_inline]] Lane& operator=(const Lane& other) { return v = other.v, *this; }
  [[gnu::always_inline]] Lane(double x) : v(x - Vector{}) {}
  [[gnu::always_inline]] explicit Lane(Vector x) : v(x) {}

  [[gnu::always_inline]] static Lane load(const double* p) {
    return Lane(Vector(*reinterpret_cast<const UnalignedVector*>(p)));
  }
  [[gnu::always_inline]] void store(double* p) const { *reinterpret_cast<UnalignedVector*>(p) = v; }
  [[gnu::always_inline]] double operator[](int k) const { return v[k]; }
  [[gnu::always_inline]] void set(int k, double x) { v[k] = x; }

  [[gnu::always_inline]] friend Lane operator+(Lane a, Lane b) { return Lane(a.v + b.v); }
  [[gnu::always_inline]] friend Lane operator-(Lane a, Lane b) { return Lane(a.v - b.v); }
  [[gnu::always_inline]] friend Lane operator*(Lane a, Lane b) { return Lane(a.v * b.v); }
  [[gnu::always_inline]] friend Lane operator/(Lane a, Lane b) { return Lane(a.v / b.v); }
  [[gnu::always_inline]] friend Lane operator-(Lane a) { return Lane(-a.v); }
  [[gnu::always_inline]] Lane& operator+=(Lane b) { return v += b.v, *this; }
  [[gnu::always_inline]] Lane& operator-=(Lane b) { return v -= b.v, *this; }
  [[gnu::always_inline]] Lane& operator*=(Lane b) { return v *= b.v, *this; }
};  // NOLINTEND(modernize-use-equals-default, performance-unnecessary-value-param)

#else  // any other compiler: lanes of one

inline constexpr int lane_width = 1;
using Lane = double;

#endif

/// How a kernel walks along an array of `E` whose index is a joint: `V` holds `width` neighbours.
template <class V, class E>
inline constexpr int width = std::is_same_v<V, E> ? 1 : lane_width;

template <class V, class E>
[[gnu::always_inline]] inline V load(const E* p) {
  if constexpr (std::is_same_v<V, E>)
    return *p;
  else
    return V::load(p);
}

template <class V, class E>
[[gnu::always_inline]] inline void store(E* p, const V& x) {
  if constexpr (std::is_same_v<V, E>)
    *p = x;
  else
    x.store(p);
}

/// Constants of the model: doubles, whatever the element. One value for all samples, or `width` neighbours.
template <class V, class E>
[[gnu::always_inline]] inline V load_constant(const double* p) {
  if constexpr (std::is_same_v<V, E>)
    return V(*p);
  else
    return V::load(p);
}

/// Lane k of the result is the sum of the lanes from k on.
template <class V, class E>
[[gnu::always_inline]] inline V sum_of_later(const V& x) {
#if defined(__GNUC__)
  if constexpr (!std::is_same_v<V, E>) {
    const typename V::Vector zero = {};
#if defined(__clang__)
    if constexpr (lane_width == 4) {
      const typename V::Vector upper = __builtin_shufflevector(x.v, zero, 2, 3, 4, 5), pairs = x.v + upper;
      return V(pairs + __builtin_shufflevector(pairs, upper, 1, 4, 3, 6));
    } else {
      return V(x.v + __builtin_shufflevector(x.v, zero, 1, 2));
    }
#else
    if constexpr (lane_width == 4) {
      const typename V::Vector upper = __builtin_shuffle(x.v, zero, typename V::Bits{2, 3, 4, 5}),
                               pairs = x.v + upper;
      return V(pairs + __builtin_shuffle(pairs, upper, typename V::Bits{1, 4, 3, 6}));
    } else {
      return V(x.v + __builtin_shuffle(x.v, zero, typename V::Bits{1, 2}));
    }
#endif
  }
#endif
  return x;
}

/// Lane 0 of x in every lane.
template <class V, class E>
[[gnu::always_inline]] inline V first_lane(const V& x) {
  if constexpr (std::is_same_v<V, E>)
    return x;
  else
    return V(x[0]);
}

#if defined(__GNUC__) && defined(__AVX__)
/// Lane k of x, y and z is lane 0, 1 and 2 of the k-th.
[[gnu::always_inline]] inline void transpose(const Lane& a, const Lane& b, const Lane& c, const Lane& d,
                                             Lane& x, Lane& y, Lane& z) {
#if defined(__clang__)
  const Lane::Vector ab = __builtin_shufflevector(a.v, b.v, 0, 4, 2, 6),
                     cd = __builtin_shufflevector(c.v, d.v, 0, 4, 2, 6);
  x.v = __builtin_shufflevector(ab, cd, 0, 1, 4, 5), z.v = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
  y.v = __builtin_shufflevector(__builtin_shufflevector(a.v, b.v, 1, 5, 3, 7),
                                __builtin_shufflevector(c.v, d.v, 1, 5, 3, 7), 0, 1, 4, 5);
#else
  using Order = Lane::Bits;
  const Lane::Vector ab = __builtin_shuffle(a.v, b.v, Order{0, 4, 2, 6}),
                     cd = __builtin_shuffle(c.v, d.v, Order{0, 4, 2, 6});
  x.v = __builtin_shuffle(ab, cd, Order{0, 1, 4, 5}), z.v = __builtin_shuffle(ab, cd, Order{2, 3, 6, 7});
  y.v = __builtin_shuffle(__builtin_shuffle(a.v, b.v, Order{1, 5, 3, 7}),
                          __builtin_shuffle(c.v, d.v, Order{1, 5, 3, 7}), Order{0, 1, 4, 5});
#endif
}
#endif

/// Lane k of the result is 1 where first + k == joint, else 0; `first <= joint < first + width`.
template <class V, class E>
[[gnu::always_inline]] inline V unit_lane(int first, int joint) {
  if constexpr (std::is_same_v<V, E>) {
    (void)first, (void)joint;
    return V(1.0);
  } else {
    static constexpr double table[7] = {0, 0, 0, 1, 0, 0, 0};
    return V::load(table + 3 - (joint - first));
  }
}

/// Lane k of the result is `upto` where first + k <= joint, else `after`.
template <class V, class E>
[[gnu::always_inline]] inline V select_up_to(int first, int joint, const V& upto, const V& after) {
  if (joint < first) return after;
  if (joint - first >= width<V, E> - 1) return upto;
  if constexpr (std::is_same_v<V, E>) {
    return upto;
  } else {
    static constexpr std::int64_t table[7] = {-1, -1, -1, -1, 0, 0, 0};
    typename V::Bits mask;
    std::memcpy(&mask, table + 3 - (joint - first), sizeof(mask));
    return V(mask ? upto.v : after.v);
  }
}

}  // namespace dynid::detail
