// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/placement.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

/// Kinetic energy of the links [J], 1/2 dq . M dq.
///
/// q [rad or m], dq: n, joints base to tip, any Eigen column expression of `Scalar`. Neither allocates nor
/// throws.
template <int N, class Scalar, class Q, class V>
Scalar kinetic_energy(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q,
                      const Eigen::MatrixBase<V>& dq) noexcept {
  using E = detail::ElementOf<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n && dq.size() == n);
  const detail::Rows3<E> rw(ws, detail::row_w), rv(ws, detail::row_v);
  Scalar energy;
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::place<Scalar>(model, ws, q.derived(), pass);
    detail::place_twists<E>(model, ws);
    E twice(0.0);
    detail::Vector3<E> w = {E(0.0), E(0.0), E(0.0)}, v = w;
    for (int i = 0; i < n; ++i) {
      const E speed = detail::coefficient<Scalar>(dq.derived(), i, pass);
      w = detail::sum(w, speed, rw.template get<E>(i));
      v = detail::sum(v, speed, rv.template get<E>(i));
      const detail::Wrench<E> momentum =
          detail::inertia_times<true>(detail::placed_moments<true, E>(model, ws, i), w, v);
      twice += detail::dot(momentum.f, v) + detail::dot(momentum.n, w);
    }
    detail::Element<Scalar>::put(energy, pass, E(twice * 0.5));
  }
  return energy;
}

/// Potential energy of the links [J] in the model's gravity, zero where every centre of mass is at the base
/// frame's origin; its derivative by q is gravity().
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. Neither allocates nor
/// throws.
template <int N, class Scalar, class Q>
Scalar potential_energy(const Model<N>& model, Workspace<N, Scalar>& ws,
                        const Eigen::MatrixBase<Q>& q) noexcept {
  using E = detail::ElementOf<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n);
  const detail::Rows3<E> rx(ws, detail::row_x), ry(ws, detail::row_y), rz(ws, detail::row_z),
      rp(ws, detail::row_p);
  const Eigen::Vector3d& g = model.base_gravity();
  Scalar energy;
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::place<Scalar>(model, ws, q.derived(), pass);
    E total(0.0);
    for (int i = 0; i < n; ++i) {
      const detail::LinkMoments& k = model.moments(i);
      const auto along = [&](const detail::Vector3<E>& a) {
        return E(a.x * g.x() + a.y * g.y() + a.z * g.z());
      };
      total -= along(rx.template get<E>(i)) * k.hx + along(ry.template get<E>(i)) * k.hy +
               along(rz.template get<E>(i)) * k.hz + along(rp.template get<E>(i)) * k.m;
    }
    detail::Element<Scalar>::put(energy, pass, total);
  }
  return energy;
}

}  // namespace dynid
