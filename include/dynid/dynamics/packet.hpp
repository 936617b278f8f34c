// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/dynamics/detail/lane.hpp"

namespace dynid {

/// Eight samples at once: a scalar for every kernel, for work that is not in a control loop.
/// `Eigen::Matrix<Packet8, N, 1> q` holds joint j of sample k in `q[j][k]`.
using Packet8 = Eigen::Array<double, 8, 1>;

namespace detail {

/// What a kernel computes with when the caller's scalar is `S`: `S` itself, save that a Packet8 is worked off
/// in passes of one machine register each, so that a recursion's state stays in registers.
template <class S>
struct Element {
  using Type = S;
  static constexpr int passes = 1;
  static const S& get(const S& x, int) { return x; }
  static void put(S& x, int, const S& e) { x = e; }
};

template <>
struct Element<Packet8> {
  using Type = Lane;
  static constexpr int passes = 8 / lane_width;
  [[gnu::always_inline]] static Lane get(const Packet8& x, int pass) {
    return load<Lane>(x.data() + pass * lane_width);
  }
  [[gnu::always_inline]] static void put(Packet8& x, int pass, const Lane& e) {
    store(x.data() + pass * lane_width, e);
  }
};

template <class S>
using ElementOf = typename Element<S>::Type;

/// Lanes of joints for element E: a register of neighbours for double, E itself otherwise.
template <class E>
struct JointLane {
  using Type = E;
};
template <>
struct JointLane<double> {
  using Type = Lane;
};

}  // namespace detail
}  // namespace dynid
