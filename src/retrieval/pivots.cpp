// SPDX-License-Identifier: Apache-2.0
#include "pivots.hpp"

#include <Eigen/Cholesky>

namespace dynid::detail {

const std::array<Eigen::Matrix4d, 11>& pseudo_inertia_basis() {
  static const std::array<Eigen::Matrix4d, 11> matrices = [] {
    std::array<Eigen::Matrix4d, 11> made;
    for (int j = 0; j < 10; ++j) {
      const Eigen::Matrix4d P = pseudo_inertia(StandardParameters::Unit(j));
      Eigen::Matrix4d& E = made[static_cast<std::size_t>(j)];
      E(0, 0) = P(3, 3);
      E.block<3, 1>(1, 0) = P.block<3, 1>(0, 3);
      E.block<1, 3>(0, 1) = P.block<1, 3>(3, 0);
      E.block<3, 3>(1, 1) = P.block<3, 3>(0, 0);
    }
    made[10] = Eigen::Vector4d(0, 1, 1, 1).asDiagonal();
    return made;
  }();
  return matrices;
}

Eigen::Matrix4d shifted_pseudo_inertia(const Eigen::Ref<const Vector10>& x, double shift) {
  Eigen::Matrix4d P = shift * pseudo_inertia_basis()[10];
  for (std::size_t j = 0; j < 10; ++j) P += x[static_cast<Eigen::Index>(j)] * pseudo_inertia_basis()[j];
  return P;
}

bool Pivots::evaluate(const Eigen::Matrix4d& P, bool derivatives) {
  for (int k = 1; k < 4; ++k) {
    // d = v^T P v with v = (-P_kk^-1 p, 1): the derivative of v drops out of the first order.
    const Eigen::MatrixXd lead = P.topLeftCorner(k, k);
    const Eigen::LLT<Eigen::MatrixXd> llt(lead);
    if (llt.info() != Eigen::Success) return false;
    Eigen::VectorXd v(k + 1);
    v.head(k) = -llt.solve(P.block(0, k, k, 1));
    v[k] = 1.0;
    const auto slot = static_cast<std::size_t>(k - 1);
    value[slot] = P(k, k) + P.block(0, k, k, 1).col(0).dot(v.head(k));
    if (!derivatives) continue;
    Eigen::MatrixXd W(k, 11);
    for (int j = 0; j < 11; ++j) {
      const Eigen::VectorXd Ev =
          pseudo_inertia_basis()[static_cast<std::size_t>(j)].topLeftCorner(k + 1, k + 1) * v;
      gradient[slot][j] = v.dot(Ev);
      W.col(j) = llt.matrixL().solve(Ev.head(k));
    }
    hessian[slot] = -2.0 * W.transpose() * W;
  }
  return true;
}

}  // namespace dynid::detail
