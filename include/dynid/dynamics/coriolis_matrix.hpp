// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

/// For a cloud of particles at r(q), Christoffel's symbols are S_ij = sum of dr/dq_i . d/dt(dr/dq_j) dm. With
/// unit twists (w, v) about one fixed point, d/dt(dr/dq_j) = v_j' + w_j' x r + w_j x r', so that over the
/// links k that both joints move (k >= max(i, j))
///   S_ij = S_i . (I_C S_j' + B_C S_j),   B = [[tr(A) 1 - A, 0], [-l x, 0]],   A = sum r' r^T dm,   l = sum
///   r' dm
/// (angular rows first). A and l add up over links as the moments do.
template <bool prismatic, class V, int N, class S, class Q, class D, class Out>
[[gnu::always_inline]] inline void coriolis_matrix(const Model<N>& model, Workspace<N, S>& ws, const Q& q,
                                                   const D& dq, Out& C, int pass) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  // A column by column, then l; later the transposed product with the joint's own twist.
  constexpr int row_a = row_free, row_l = row_a + 9, row_dw = row_l + 3, row_dv = row_dw + 3;
  constexpr int row_omega = row_dv + 3, row_velocity = row_omega + 3;  // of the links
  constexpr int row_bias = row_velocity + 3;                           // row_bias + 3: its force
  constexpr int row_back = row_omega;                                  // once the links' twists have served
  static_assert(row_bias + 6 <= Workspace<N, S>::rows_of_kernels);
  const int n = model.size();
  place<S>(model, ws, q, pass);
  place_twists<V>(model, ws);
  const Rows3<E> rw(ws, row_w), rv(ws, row_v), romega(ws, row_omega), rvelocity(ws, row_velocity);
  const Rows3<E> rdw(ws, row_dw), rdv(ws, row_dv), rl(ws, row_l), rback(ws, row_back);
  const Rows3<E> rf(ws, row_force), rn(ws, row_couple), rbn(ws, row_bias), rbf(ws, row_bias + 3);
  const Rows3<E> ra[3] = {{ws, row_a}, {ws, row_a + 3}, {ws, row_a + 6}};
  const E zero(0.0);
  Vector3<E> omega = {zero, zero, zero}, velocity = omega;
  for (int i = 0; i < n; ++i) {
    const E speed = coefficient<S>(dq, i, pass);
    omega = sum(omega, speed, rw.template get<E>(i));
    velocity = sum(velocity, speed, rv.template get<E>(i));
    romega.set(i, omega), rvelocity.set(i, velocity);
  }
  for (int g = 0; g * lanes < n; ++g) {
    const int at = first_of_group<lanes>(g, n), slot = g * lanes;
    const Moments<V> k = placed_moments<prismatic, V>(model, ws, at);
    set_moments(ws, slot, k);
    const Vector3<V> om = romega.template get<V>(at), vel = rvelocity.template get<V>(at);
    const Vector3<V> w = rw.template get<V>(at), v = rv.template get<V>(at);
    ra[0].set(slot, sum(cross(om, Vector3<V>{k.xx, k.xy, k.xz}), k.h.x, vel));
    ra[1].set(slot, sum(cross(om, Vector3<V>{k.xy, k.yy, k.yz}), k.h.y, vel));
    ra[2].set(slot, sum(cross(om, Vector3<V>{k.xz, k.yz, k.zz}), k.h.z, vel));
    Vector3<V> l = cross(om, k.h);
    if constexpr (prismatic) l = sum(l, k.m, vel);
    rl.set(slot, l);
    rdw.set(at, cross(om, w));
    rdv.set(at, sum(cross(om, v), cross(vel, w)));
  }
  sum_inwards<V>(ws, n, row_moments + !prismatic, 10 - !prismatic);
  sum_inwards<V>(ws, n, row_a, 12);
  for (int g = 0; g * lanes < n; ++g) {
    const int at = first_of_group<lanes>(g, n), slot = g * lanes;
    const Moments<V> k = get_moments<V>(ws, slot);
    const Vector3<V> w = rw.template get<V>(at), v = rv.template get<V>(at), l = rl.template get<V>(slot);
    const Vector3<V> a0 = ra[0].template get<V>(slot), a1 = ra[1].template get<V>(slot),
                     a2 = ra[2].template get<V>(slot);
    const V trace = a0.x + a1.y + a2.z;
    const Wrench<V> F = inertia_times<prismatic>(k, w, v);
    rf.set(at, F.f), rn.set(at, F.n);
    Wrench<V> bias = inertia_times<prismatic>(k, rdw.template get<V>(at), rdv.template get<V>(at));
    bias.f = sum(bias.f, cross(w, l));
    bias.n = sum(bias.n, trace, w);
    bias.n.x -= a0.x * w.x + a1.x * w.y + a2.x * w.z;
    bias.n.y -= a0.y * w.x + a1.y * w.y + a2.y * w.z;
    bias.n.z -= a0.z * w.x + a1.z * w.y + a2.z * w.z;
    rbf.set(at, bias.f), rbn.set(at, bias.n);
    Vector3<V> back = sum(cross(l, v), trace, w);
    back.x -= dot(a0, w), back.y -= dot(a1, w), back.z -= dot(a2, w);
    rback.set(at, back);
  }
  for (int j = 0; j < n; ++j) {
    for (int g = 0; g * lanes < n; ++g) {
      const int at = first_of_group<lanes>(g, n);
      V above(0.0), below(0.0);
      if (at <= j)
        above = dot(rw.template get<V>(at), rbn.template all<V>(j)) +
                dot(rv.template get<V>(at), rbf.template all<V>(j));
      if (at + lanes > j + 1)
        below = dot(rn.template get<V>(at), rdw.template all<V>(j)) +
                dot(rf.template get<V>(at), rdv.template all<V>(j)) +
                dot(rback.template get<V>(at), rw.template all<V>(j));
      write_rows<S>(C, at, j, pass, select_up_to<V, E>(at, j, above, below));
    }
  }
}

}  // namespace detail

/// Coriolis matrix S(q, dq) by Christoffel's symbols of the first kind: S dq is the torque of the velocities,
/// dM/dt - 2 S is skew-symmetric and M' = S + S^T.
///
/// q [rad or m], dq: n, joints base to tip, any Eigen column expression of `Scalar`. S: n x n, written whole;
/// any writable Eigen matrix of that size (a column-major one is quickest). Neither allocates nor throws.
template <int N, class Scalar, class Q, class V, class Out>
void coriolis_matrix(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                     const Eigen::MatrixBase<V>& dq, Out&& S) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size());
  eigen_assert(S.rows() == model.size() && S.cols() == model.size());
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::with_lanes<detail::ElementOf<Scalar>>(model, [&](auto lane) {
      using L = decltype(lane);
      if (model.has_prismatic())
        detail::coriolis_matrix<true, L>(model, ws, q.derived(), dq.derived(), S, pass);
      else
        detail::coriolis_matrix<false, L>(model, ws, q.derived(), dq.derived(), S, pass);
    });
  }
}

}  // namespace dynid
