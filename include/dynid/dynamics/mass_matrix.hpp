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
  const int n = model.size();
  placed_groups<S, true, V>(model, ws, q, pass, [&](int g, int at, const Placed<V>& placed) {
    place_twists<V>(model, ws, at, placed.z, placed.p);
    set_moments(ws, g * lanes, placed_moments<prismatic, V, E>(model, at, placed));
  });
  sum_inwards<V>(ws, n, row_moments + !prismatic, 10 - !prismatic);
  const Rows3<E> rw(ws, row_w), rv(ws, row_v), rf(ws, row_force), rn(ws, row_couple);
  for (int g = 0; g * lanes < n; ++g) {
    const int at = first_of_group<lanes>(g, n);
    const Wrench<V> F = inertia_times<prismatic>(get_moments<V>(ws, g * lanes), rw.template get<V>(at),
                                                 rv.template get<V>(at));
    rf.set(at, F.f), rn.set(at, F.n);
  }
  for (int j = 0; j < n; ++j) {
    const Vector3<V> f = rf.template all<V>(j), m = rn.template all<V>(j);
    for (int g = 0; g * lanes <= j; ++g) {
      const int at = first_of_group<lanes>(g, n);
      if (at > j) break;
      const V x = dot(rw.template get<V>(at), m) + dot(rv.template get<V>(at), f);
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
