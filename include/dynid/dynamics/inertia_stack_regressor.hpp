// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/regressor.hpp"

namespace dynid {

/// Inertia-stack regressor, eq. (17): Ys(q) pi is the lower triangle of M(q), row by row (m11, m21, m22,
/// m31...), and then g(q).
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. Ys: (n (n + 1) / 2 + n) x 10
/// n, written whole, any writable Eigen matrix of that size; columns as in regressor(). Neither allocates nor
/// throws.
template <int N, class Scalar, class Q, class Out>
void inertia_stack_regressor(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                             Out&& Ys) noexcept {
  using E = detail::ElementOf<Scalar>;
  using Lanes = detail::Element<Scalar>;
  using Vector = detail::Vector3<E>;
  const int n = model.size(), stack = n * (n + 1) / 2;
  eigen_assert(q.size() == n && Ys.rows() == stack + n && Ys.cols() == 10 * n);
  E *const c = ws.row(0), *const s = ws.row(1);
  const detail::Rows3<E> rw(ws, 2), rv(ws, 5);   // unit twists of the joints, carried outwards
  const detail::Rows3<E> tw(ws, 8), tv(ws, 11);  // the same in the robot's link frame
  for (int pass = 0; pass < Lanes::passes; ++pass) {
    detail::joint_rotations<Scalar>(model, q.derived(), pass, c, s);
    Vector a = detail::base_motion<E>(model).a;
    for (int k = 0; k < n; ++k) {
      const detail::JointFrame& f = model.frame(k);
      const Vector p = detail::origin<true>(f, detail::coefficient<Scalar>(q.derived(), k, pass));
      a = detail::to_link(a, f.ca, f.sa, c[k], s[k]);
      for (int j = 0; j < k; ++j) {
        const Vector w = rw.template get<E>(j), v = detail::sum(rv.template get<E>(j), detail::cross(w, p));
        rw.set(j, detail::to_link(w, f.ca, f.sa, c[k], s[k]));
        rv.set(j, detail::to_link(v, f.ca, f.sa, c[k], s[k]));
      }
      rw.set(k, Vector{E(0.0), E(0.0), E(f.revolute)});
      rv.set(k, Vector{E(0.0), E(0.0), E(1.0 - f.revolute)});
      for (int j = 0; j <= k; ++j) {
        tw.set(j, detail::turned(model.axes(k), rw.template get<E>(j)));
        tv.set(j, detail::turned(model.axes(k), rv.template get<E>(j)));
      }
      const Vector at = detail::turned(model.axes(k), a);

      const int column = 10 * k;
      const auto put = [&](int row, int col, const E& x) {
        Lanes::put(Ys.coeffRef(row, column + col), pass, x);
      };
      const auto put_row = [&](int row, const E& m, const Vector& h, const std::array<E, 6>& J) {
        put(row, 0, m), put(row, 1, h.x), put(row, 2, h.y), put(row, 3, h.z);
        for (int e = 0; e < 6; ++e) put(row, 4 + e, J[e]);
      };
      const E zero(0.0);
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j <= i; ++j) {
          const int row = i * (i + 1) / 2 + j;
          if (i > k) {
            put_row(row, zero, {zero, zero, zero}, {zero, zero, zero, zero, zero, zero});
            continue;
          }
          // v_i . v_j m + h . (v_i x w_j + v_j x w_i) + w_i . J w_j
          const Vector wi = tw.template get<E>(i), vi = tv.template get<E>(i);
          const Vector wj = tw.template get<E>(j), vj = tv.template get<E>(j);
          put_row(row, detail::dot(vi, vj), detail::sum(detail::cross(vi, wj), detail::cross(vj, wi)),
                  {E(wi.x * wj.x), E(wi.x * wj.y + wi.y * wj.x), E(wi.y * wj.y), E(wi.x * wj.z + wi.z * wj.x),
                   E(wi.y * wj.z + wi.z * wj.y), E(wi.z * wj.z)});
        }
        const bool moves = i <= k;
        const Vector w = moves ? tw.template get<E>(i) : Vector{zero, zero, zero};
        const Vector v = moves ? tv.template get<E>(i) : Vector{zero, zero, zero};
        put_row(stack + i, detail::dot(v, at), detail::cross(at, w), {zero, zero, zero, zero, zero, zero});
      }
    }
  }
}

}  // namespace dynid
