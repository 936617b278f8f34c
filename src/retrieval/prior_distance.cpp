// SPDX-License-Identifier: Apache-2.0
#include "prior_distance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <limits>

#include "pivots.hpp"

namespace dynid::detail {
namespace {

/// What differences of link i's unknowns are multiplied by. In x every link is in its own units already; a
/// scale given is per standard parameter about the frame's origin, of which x is a linear function.
Matrix10 euclidean_scale(const Prepared& prepared, int i) {
  const Prior& prior = prepared.reference();
  if (prior.scale.size() == 0) return Matrix10::Identity();
  const Prepared::Units& units = prepared.units()[static_cast<std::size_t>(i)];
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = units.origin;
  StandardParameters unit = prepared.p_scale().segment<10>(10 * i);
  unit.segment<3>(1) *= units.mass;
  return prior.scale.segment<10>(10 * i).asDiagonal() * transform_matrix(pose) * unit.asDiagonal();
}

}  // namespace

double prior_distance(const Prepared& prepared, const Eigen::VectorXd& x, Eigen::VectorXd* gradient,
                      Eigen::MatrixXd* hessian) {
  const Prior& prior = prepared.reference();
  const Eigen::VectorXd x0 = prepared.to_x(stack(prior.links));
  if (gradient) *gradient = Eigen::VectorXd::Zero(x.size());
  if (hessian) *hessian = Eigen::MatrixXd::Zero(x.size(), x.size());
  double sum = 0.0;
  for (int i = 0; i < prepared.links(); ++i) {
    const int at = 10 * i;
    if (prior.distance == PriorDistance::euclidean) {
      const Matrix10 S = euclidean_scale(prepared, i);
      const Vector10 difference = S * (x - x0).segment<10>(at);
      sum += difference.squaredNorm();
      if (gradient) gradient->segment<10>(at) = 2.0 * S.transpose() * difference;
      if (hessian) hessian->block<10, 10>(at, at) = 2.0 * S.transpose() * S;
      continue;
    }
    const Eigen::Matrix4d P = shifted_pseudo_inertia(x.segment<10>(at), 0.0);
    const Eigen::LLT<Eigen::Matrix4d> llt(P), llt0(shifted_pseudo_inertia(x0.segment<10>(at), 0.0));
    if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    const Eigen::Matrix4d inverse = llt.solve(Eigen::Matrix4d::Identity());
    const Eigen::Matrix4d inverse0 = llt0.solve(Eigen::Matrix4d::Identity());
    const double log_ratio = 2.0 * (llt0.matrixLLT().diagonal().array().log().sum() -
                                    llt.matrixLLT().diagonal().array().log().sum());
    sum += log_ratio + (P * inverse0).trace() - 4.0;
    for (int j = 0; (gradient || hessian) && j < 10; ++j) {
      const Eigen::Matrix4d& E = pseudo_inertia_basis()[static_cast<std::size_t>(j)];
      if (gradient) (*gradient)[at + j] = (E * (inverse0 - inverse)).trace();
      if (!hessian) continue;
      const Eigen::Matrix4d around = inverse * E * inverse;
      for (int l = 0; l <= j; ++l)
        (*hessian)(at + j, at + l) = (*hessian)(at + l, at + j) =
            (around * pseudo_inertia_basis()[static_cast<std::size_t>(l)]).trace();
    }
  }
  return sum;
}

}  // namespace dynid::detail
