// SPDX-License-Identifier: Apache-2.0
#include "link_derivatives.hpp"

#include <Eigen/Core>

namespace dynid::detail {

Matrix10 link_jacobian(const Eigen::Ref<const Vector10>& x) {
  const double m = x[0];
  const Eigen::Vector3d h = x.segment<3>(1);
  Matrix10 J = Matrix10::Identity();
  J.block<3, 1>(1, 0) = -h / (m * m);
  J.block<3, 3>(1, 1) = Eigen::Matrix3d::Identity() / m;
  // I = J_o - (|h|^2 1 - h h^T)/m: column by column.
  for (int a = -1; a < 3; ++a) {
    Eigen::Matrix3d d;
    if (a < 0) {
      d = (h.squaredNorm() * Eigen::Matrix3d::Identity() - h * h.transpose()) / (m * m);
    } else {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(a);
      d = -(2.0 * h[a] * Eigen::Matrix3d::Identity() - e * h.transpose() - h * e.transpose()) / m;
    }
    StandardParameters column = StandardParameters::Zero();
    set_inertia_tensor(column, d);
    J.block<6, 1>(4, a + 1) = column.tail<6>();
  }
  return J;
}

Matrix10 link_hessian(const Eigen::Ref<const Vector10>& x, const Eigen::Ref<const Vector10>& weight) {
  const double m = x[0];
  const Eigen::Vector3d h = x.segment<3>(1), c = weight.segment<3>(1);
  Matrix10 H = Matrix10::Zero();
  H.block<3, 1>(1, 0) = -c / (m * m);
  H(0, 0) = 2.0 * c.dot(h) / (m * m * m);
  // sum_k weight_k I_k holds -h^T B h / m.
  Eigen::Matrix3d B = -0.5 * inertia_tensor(weight);
  B(0, 0) = weight[6] + weight[9];
  B(1, 1) = weight[4] + weight[9];
  B(2, 2) = weight[4] + weight[6];
  H.block<3, 3>(1, 1) -= 2.0 / m * B;
  H.block<3, 1>(1, 0) += 2.0 / (m * m) * B * h;
  H(0, 0) -= 2.0 / (m * m * m) * h.dot(B * h);
  H.block<1, 3>(0, 1) = H.block<3, 1>(1, 0).transpose();
  return H;
}

}  // namespace dynid::detail
