// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

namespace detail {

/// M_ij = S_i . I_C(j) S_j for i <= j, column by column, lanes along the rows; below the diagonal the same
/// with i and j exchanged, if `both`, else nothing that means anything.
template <bool both, bool prismatic, class V, int N, class S, class Q, class Out>
[[gnu::always_inline]] inline void mass_matrix(const Model<N>& model, Workspace<N, S>& ws, const Q& q, Out& M,
                                               int pass) {
  using E = ElementOf<S>;
  constexpr int lanes = width<V, E>;
  const int n = model.size(), groups = (n + lanes - 1) / lanes;
  place_groups<prismatic, S, V>(model, ws, q, pass);
  // Group g's lanes are at g * lanes: groups overlap in joints, not in storage.
  const Rows3<E> rw(ws, row_w), rv(ws, row_v), rf(ws, row_force), rn(ws, row_couple);
  Moments<V> carried = {};  // by the first joint of the group further out
#pragma GCC unroll 4
  for (int g = groups - 1; g >= 0; --g) {
    const int at = first_of_group<lanes>(g, n), end = g + 1 < groups ? first_of_group<lanes>(g + 1, n) : n;
    const Placed<V> placed = placed_group<S, V>(ws, at);
    Moments<V> k = placed_moments<prismatic, V, E>(model, at, placed);
    k.template for_each<prismatic>(carried, [&](V& x, V& outer) {
      x = sum_of_later<V, E>(end < at + lanes ? select_up_to<V, E>(at, end - 1, x, V(0.0)) : x);
      if (g + 1 < groups) x += outer;
      outer = first_lane<V, E>(x);
    });
    const auto [w, v] = unit_twists<prismatic, V, E>(model, at, placed.z, placed.p);
    const Wrench<V> F = inertia_times<prismatic>(k, w, v);
    rw.set(g * lanes, w), rv.set(g * lanes, v), rf.set(g * lanes, F.f), rn.set(g * lanes, F.n);
  }
#pragma GCC unroll 8
  for (int j = 0; j < n; ++j) {
    // Of a joint in two groups only the outer one has all that it carries.
    const int last = first_of_group<lanes>(groups - 1, n),
              slot = j < last ? j : j - last + (groups - 1) * lanes;
    const Vector3<V> f = rf.template all<V>(slot), m = rn.template all<V>(slot);
#pragma GCC unroll 4
    for (int g = 0; g * lanes <= j; ++g) {
      const int at = first_of_group<lanes>(g, n);
      const V x = dot(rw.template get<V>(g * lanes), m) + dot(rv.template get<V>(g * lanes), f);
      write_rows<S>(M, at, j, pass, x);
      // What a column has below its diagonal is not right until the later ones have been here.
      if constexpr (both) write_columns<S>(M, j, at, j, pass, x);
    }
  }
}

}  // namespace detail

/// Mass matrix M(q) [kg m^2, kg m, kg], symmetric, all entries.
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. M: n x n, written whole; any
/// writable Eigen matrix of that size (a column-major one is quickest). Neither allocates nor throws.
template <int N, class Scalar, class Q, class Out>
void mass_matrix(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                 Out&& M) noexcept {
  eigen_assert(q.size() == model.size() && M.rows() == model.size() && M.cols() == model.size());
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::with_lanes<detail::ElementOf<Scalar>>(model, [&](auto lane) {
      using L = decltype(lane);
      if (model.has_prismatic())
        detail::mass_matrix<true, true, L>(model, ws, q.derived(), M, pass);
      else
        detail::mass_matrix<true, false, L>(model, ws, q.derived(), M, pass);
    });
  }
}

/// The same with `armature` [kg m^2 or kg] (n, of double: rotor inertia seen at the joints) added to the
/// diagonal.
template <int N, class Scalar, class Q, class Out, class I>
void mass_matrix(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q, Out&& M,
                 const Eigen::MatrixBase<I>& armature) noexcept {
  mass_matrix(model, ws, q, M);
  for (int i = 0; i < model.size(); ++i) M.coeffRef(i, i) += Scalar(armature.coeff(i));
}

}  // namespace dynid
