// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"

namespace dynid {

namespace detail {

/// x becomes M^-1 x; M (n x n, its upper triangle is read) becomes its factors U^T D U.
template <class E, class X>
inline void solve_positive(const ElementMatrix<E>& M, int n, X& x) {
  for (int j = 0; j < n; ++j) {
    const E inverse = E(1.0) / M(j, j);
    for (int i = j + 1; i < n; ++i) {
      const E u = M(j, i) * inverse;
      for (int k = i; k < n; ++k) M(i, k) -= u * M(j, k);
      M(j, i) = u;
      x[i] -= u * x[j];
    }
  }
  for (int j = n - 1; j >= 0; --j) {
    x[j] = x[j] / M(j, j);
    for (int i = j + 1; i < n; ++i) x[j] -= M(j, i) * x[i];
  }
}

template <int N, class S, class Q, class V, class T, class I, class A>
void forward_dynamics(const Model<N>& model, Workspace<N, S>& ws, const Q& q, const V& dq, const T& tau,
                      const I& armature, A& ddq) noexcept {
  using E = ElementOf<S>;
  const int n = model.size();
  const ElementMatrix<E> M{ws.row(ws.rows_of_kernels), ws.row(1) - ws.row(0)};
  for (int pass = 0; pass < Element<S>::passes; ++pass) {
    with_lanes<E>(model, [&](auto lane) {
      using L = decltype(lane);
      if (model.has_prismatic()) {
        inverse_dynamics<true>(model, ws, q, dq, Zeros(), ddq, pass);
        mass_matrix<false, true, L>(model, ws, q, M, pass);
      } else {
        inverse_dynamics<false>(model, ws, q, dq, Zeros(), ddq, pass);
        mass_matrix<false, false, L>(model, ws, q, M, pass);
      }
    });
    if constexpr (!std::is_same_v<I, Zeros>)
      for (int i = 0; i < n; ++i) M(i, i) += E(double(armature.coeff(i)));
    E* const x = ws.row(0);
    for (int i = 0; i < n; ++i)
      x[i] = coefficient<S>(tau, i, pass) - E(Element<S>::get(ddq.coeffRef(i), pass));
    solve_positive(M, n, x);
    for (int i = 0; i < n; ++i) Element<S>::put(ddq.coeffRef(i), pass, x[i]);
  }
}

}  // namespace detail

/// Joint accelerations under the joint torques tau: the solution of M(q) ddq = tau - S(q, dq) dq - g(q).
///
/// q [rad or m], dq, tau [N m or N] (friction already taken off): n, joints base to tip, any Eigen column
/// expression of `Scalar`. ddq: n, written; any writable Eigen column vector of size n that is not an alias
/// of an input. M is factored as U^T D U: where it is not positive definite the result means nothing. Neither
/// allocates nor throws.
template <int N, class Scalar, class Q, class V, class T, class A>
void forward_dynamics(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                      const Eigen::MatrixBase<V>& dq, const Eigen::MatrixBase<T>& tau, A&& ddq) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size() && tau.size() == model.size());
  eigen_assert(ddq.size() == model.size());
  detail::forward_dynamics(model, ws, q.derived(), dq.derived(), tau.derived(), detail::Zeros(), ddq);
}

/// The same with `armature` [kg m^2 or kg] (n, of double: rotor inertia seen at the joints) added to the
/// diagonal of M.
template <int N, class Scalar, class Q, class V, class T, class A, class I>
void forward_dynamics(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                      const Eigen::MatrixBase<V>& dq, const Eigen::MatrixBase<T>& tau, A&& ddq,
                      const Eigen::MatrixBase<I>& armature) noexcept {
  eigen_assert(q.size() == model.size() && dq.size() == model.size() && tau.size() == model.size());
  eigen_assert(ddq.size() == model.size() && armature.size() == model.size());
  detail::forward_dynamics(model, ws, q.derived(), dq.derived(), tau.derived(), armature.derived(), ddq);
}

}  // namespace dynid
