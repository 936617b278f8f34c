// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>

namespace dynid {

inline Eigen::Matrix3d inertia_tensor(const StandardParameters& p) noexcept {
  Eigen::Matrix3d J;
  J << p[4], p[5], p[7], p[5], p[6], p[8], p[7], p[8], p[9];
  return J;
}

inline void set_inertia_tensor(StandardParameters& p, const Eigen::Matrix3d& J) noexcept {
  p.tail<6>() << J(0, 0), J(0, 1), J(1, 1), J(0, 2), J(1, 2), J(2, 2);
}

inline StandardParameters to_standard(const LinkInertia& link) noexcept {
  StandardParameters p;
  p[0] = link.mass;
  p.segment<3>(1) = link.mass * link.com;
  const Eigen::Matrix3d steiner =
      link.com.squaredNorm() * Eigen::Matrix3d::Identity() - link.com * link.com.transpose();
  set_inertia_tensor(p, link.inertia + link.mass * steiner);
  return p;
}

inline LinkInertia from_standard(const StandardParameters& p) noexcept {
  LinkInertia link;
  link.mass = p[0];
  if (link.mass != 0.0) link.com = p.segment<3>(1) / link.mass;
  const Eigen::Matrix3d steiner =
      link.com.squaredNorm() * Eigen::Matrix3d::Identity() - link.com * link.com.transpose();
  link.inertia = inertia_tensor(p) - link.mass * steiner;
  return link;
}

inline Eigen::Matrix4d pseudo_inertia(const StandardParameters& p) noexcept {
  const Eigen::Matrix3d J = inertia_tensor(p);
  Eigen::Matrix4d P;
  P.topLeftCorner<3, 3>() = 0.5 * J.trace() * Eigen::Matrix3d::Identity() - J;
  P.topRightCorner<3, 1>() = p.segment<3>(1);
  P.bottomLeftCorner<1, 3>() = p.segment<3>(1).transpose();
  P(3, 3) = p[0];
  return P;
}

inline StandardParameters from_pseudo_inertia(const Eigen::Matrix4d& P) noexcept {
  const Eigen::Matrix3d Sigma = P.topLeftCorner<3, 3>();
  StandardParameters p;
  p[0] = P(3, 3);
  p.segment<3>(1) = P.topRightCorner<3, 1>();
  set_inertia_tensor(p, Sigma.trace() * Eigen::Matrix3d::Identity() - Sigma);
  return p;
}

inline ConsistencyMargins consistency_margins(const LinkInertia& link) noexcept {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(link.inertia, Eigen::EigenvaluesOnly);
  return {link.mass, 0.5 * link.inertia.trace() - eigen.eigenvalues()[2]};
}

inline ConsistencyMargins consistency_margins(const StandardParameters& p) noexcept {
  return consistency_margins(from_standard(p));
}

inline StandardParameters transformed(const StandardParameters& p, const Eigen::Isometry3d& pose) noexcept {
  // The pseudo-inertia is the density's second moment in homogeneous coordinates, so it moves like x x^T.
  return from_pseudo_inertia(pose.matrix() * pseudo_inertia(p) * pose.matrix().transpose());
}

inline Eigen::Matrix<double, 10, 10> transform_matrix(const Eigen::Isometry3d& pose) noexcept {
  Eigen::Matrix<double, 10, 10> T;
  for (int k = 0; k < 10; ++k) T.col(k) = transformed(StandardParameters::Unit(k), pose);
  return T;
}

}  // namespace dynid
