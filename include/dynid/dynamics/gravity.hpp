// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/detail/sweep.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {

/// Gravity torque g(q) [N m or N]: what it takes to hold the arm at q.
///
/// q [rad or m]: n, joints base to tip, any Eigen column expression of `Scalar`. g: n, written; any writable
/// Eigen column vector, already of size n. Neither allocates nor throws.
template <int N, class Scalar, class Q, class G>
void gravity(const Model<N>& model, Workspace<N, Scalar>& ws, const Eigen::MatrixBase<Q>& q, G&& g) noexcept {
  using E = detail::ElementOf<Scalar>;
  const int n = model.size();
  eigen_assert(q.size() == n && g.size() == n);
  E *const c = ws.row(0), *const s = ws.row(1), *const ax = ws.row(2), *const ay = ws.row(3),
           *const az = ws.row(4);
  for (int pass = 0; pass < detail::Element<Scalar>::passes; ++pass) {
    detail::joint_rotations<Scalar>(model, q.derived(), pass, c, s);
    detail::Vector3<E> a = detail::base_motion<E>(model).a;
    for (int i = 0; i < n; ++i) {
      const detail::JointFrame& frame = model.frame(i);
      a = detail::to_link(a, frame.ca, frame.sa, c[i], s[i]);
      ax[i] = a.x, ay[i] = a.y, az[i] = a.z;
    }
    // Mass and first moment of the links from i on: all that gravity acts upon.
    E mass(0.0);
    detail::Vector3<E> h = {E(0.0), E(0.0), E(0.0)};
    for (int i = n - 1; i >= 0; --i) {
      const detail::JointFrame& frame = model.frame(i);
      const detail::LinkMoments& k = model.reduced(i);
      mass += E(k.m);
      h.x += E(k.hx), h.y += E(k.hy), h.z += E(k.hz);
      const E torque = (h.x * ay[i] - h.y * ax[i]) * frame.revolute + mass * az[i] * (1.0 - frame.revolute);
      detail::Element<Scalar>::put(g.coeffRef(i), pass, torque);
      const detail::Vector3<E> p =
          detail::origin<true>(frame, detail::coefficient<Scalar>(q.derived(), i, pass));
      h = detail::sum(detail::to_parent(h, frame.ca, frame.sa, c[i], s[i]), mass, p);
    }
  }
}

}  // namespace dynid
