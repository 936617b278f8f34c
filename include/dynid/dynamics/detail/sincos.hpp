// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "dynid/dynamics/detail/lane.hpp"

namespace dynid::detail {

/// Sine and cosine of a scalar of any kind.
template <class T>
[[gnu::always_inline]] inline void sincos(const T& x, T& s, T& c) {
  using std::cos;
  using std::sin;
  s = sin(x);
  c = cos(x);
}

#if defined(__GNUC__)

/// Sine and cosine of each lane [rad], within 1 ulp; any input (an angle beyond `sincos_range`, an infinity
/// or a NaN goes to the standard library, lane by lane).
///
/// x = k pi/2 + r with pi/2 in three parts of 33, 33 and 53 bits (Cody and Waite), so that k times each of
/// the first two is exact and r is known beyond double precision; then fdlibm's minimax polynomials on |r| <=
/// pi/4.
inline constexpr double sincos_range = 1e5;

/// Whether every lane of a comparison's result is true.
[[gnu::always_inline]] inline bool all(const Lane::Bits& result) {
#if defined(__AVX__)
  return __builtin_ia32_movmskpd256((Lane::Vector)result) == 15;
#elif defined(__SSE2__)
  return __builtin_ia32_movmskpd((Lane::Vector)result) == 3;
#else
  std::int64_t r = result[0];
  for (int lane = 1; lane < lane_width; ++lane) r &= result[lane];
  return r != 0;
#endif
}

[[gnu::noinline, gnu::cold]] inline void sincos_any(const double* x, double* s, double* c) {
  for (int k = 0; k < lane_width; ++k) s[k] = std::sin(x[k]), c[k] = std::cos(x[k]);
}

[[gnu::always_inline]] inline void sincos(const Lane& angle, Lane& sine, Lane& cosine) {
  using Vector = Lane::Vector;
  using Bits = Lane::Bits;
  constexpr double round_to_integer = 0x1.8p52;  // adding it leaves the nearest integer in the low bits
  const Vector x = angle.v;

  const Vector shifted = x * 0x1.45f306dc9c883p-1 + round_to_integer;
  const Vector k = shifted - round_to_integer;
  const Bits quadrant = (Bits)shifted;
  const Vector r1 = x - k * 0x1.921fb544p+0, r = r1 - k * 0x1.0b4611a6p-34;
  const Vector tail =
      ((r1 - r) - k * 0x1.0b4611a6p-34) - k * 0x1.3198a2e037073p-69;  // what rounding took from r

  const Vector z = r * r, w = z * z;
  const Vector sin_high = -1.98412698298579493134e-04 + z * 2.75573137070700676789e-06 +
                          w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
  const Vector cos_low = z * (4.16666666666666019037e-02 + z * -1.38888888888741095749e-03 +
                              w * (2.48015872894767294178e-05 + z * -2.75573143513906633035e-07 +
                                   w * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)));
  const Vector half = 0.5 * z, one_less = 1.0 - half;
  const Vector sin_r =
      r + (z * r * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * sin_high)) +
           tail * one_less);
  const Vector cos_r = one_less + (((1.0 - one_less) - half) + (z * cos_low - r * tail));

  const Bits swap = -(quadrant & 1);
  const Bits sin_bits = (Bits)sin_r, cos_bits = (Bits)cos_r;
  const Bits difference = (sin_bits ^ cos_bits) & swap;
  const Bits s = (sin_bits ^ difference) ^ ((quadrant & 2) << 62);
  const Bits c = (cos_bits ^ difference) ^ (((quadrant + 1) & 2) << 62);
  sine.v = (Vector)s;
  cosine.v = (Vector)c;

  const Bits inside = (x <= sincos_range) & (x >= -sincos_range);
  if (__builtin_expect(!all(inside), 0)) {
    double in[lane_width], out_s[lane_width], out_c[lane_width];
    angle.store(in);
    sincos_any(in, out_s, out_c);
    sine = Lane::load(out_s);
    cosine = Lane::load(out_c);
  }
}

#endif

}  // namespace dynid::detail
