// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/objective.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

namespace {

void require(bool holds, const std::string& rule) {
  if (!holds) throw Error("retrieval objective: " + rule);
}

}  // namespace

Objective Objective::two_step(const Eigen::MatrixXd& K, const Eigen::VectorXd& pi_hat,
                              const Eigen::VectorXd& weights) {
  require(K.rows() > 0, "no coefficient is kept");
  require(K.cols() > 0 && K.cols() % 10 == 0,
          "ten columns a link are needed, got " + std::to_string(K.cols()));
  require(K.rows() == pi_hat.size(), "one coefficient a row is needed");
  require(weights.size() == 0 || weights.size() == pi_hat.size(), "one weight a coefficient is needed");
  require(K.allFinite() && pi_hat.allFinite(), "a coefficient is not finite");
  require(weights.size() == 0 || (weights.allFinite() && weights.minCoeff() > 0.0),
          "a weight is not positive");
  Objective objective;
  objective.A_ = objective.weighted_A_ = K;
  objective.b_ = objective.weighted_b_ = pi_hat;
  if (weights.size() != 0) {
    objective.weighted_A_ = weights.asDiagonal() * K;
    objective.weighted_b_ = weights.cwiseProduct(pi_hat);
  }
  return objective;
}

Objective Objective::one_step(const Eigen::MatrixXd& R, const Eigen::VectorXd& z, double residual_energy,
                              int parameters) {
  require(parameters > 0 && parameters % 10 == 0 && R.cols() >= parameters, "ten columns a link are needed");
  require(R.rows() == z.size(), "the factor and its right-hand side differ in rows");
  require(R.allFinite() && z.allFinite() && residual_energy >= 0.0, "the factor is not finite");
  const Eigen::Index n = parameters;
  const Eigen::Index extra = R.cols() - n;
  Objective objective;
  objective.constant_ = residual_energy;
  Eigen::MatrixXd A = R.leftCols(n);
  Eigen::VectorXd b = z;
  if (extra > 0) {
    // Rotate so that the free unknowns stand in the first rows alone: what is left below no longer knows of
    // them.
    const Eigen::MatrixXd free_columns = R.rightCols(extra);
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(free_columns);
    const Eigen::Index rank = qr.rank();
    A.applyOnTheLeft(qr.householderQ().adjoint());
    b.applyOnTheLeft(qr.householderQ().adjoint());
    const auto triangle = qr.matrixR().topLeftCorner(rank, rank).template triangularView<Eigen::Upper>();
    objective.unknowns_of_pi_ = Eigen::MatrixXd::Zero(extra, n);
    objective.unknowns_offset_ = Eigen::VectorXd::Zero(extra);
    objective.unknowns_of_pi_.topRows(rank) = triangle.solve(A.topRows(rank));
    objective.unknowns_offset_.head(rank) = triangle.solve(b.head(rank));
    objective.unknowns_of_pi_ = (qr.colsPermutation() * objective.unknowns_of_pi_).eval();
    objective.unknowns_offset_ = (qr.colsPermutation() * objective.unknowns_offset_).eval();
    A = A.bottomRows(A.rows() - rank).eval();
    b = b.tail(b.size() - rank).eval();
  }
  // The rows that the parameters do not reach are residual, not objective.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  const Eigen::Index rank = qr.rank();
  b.applyOnTheLeft(qr.householderQ().adjoint());
  objective.constant_ += b.tail(b.size() - rank).squaredNorm();
  Eigen::MatrixXd upper = qr.matrixR().topRows(rank).template triangularView<Eigen::Upper>();
  objective.A_ = upper * qr.colsPermutation().transpose();
  objective.b_ = b.head(rank);
  // In units of the residual, so that the weight of the penalties beside it, and with it the work, does not
  // depend on how many samples there were; nor on rounding, where data without noise leaves no residual.
  const double energy = std::max(objective.constant_, 1e-6 * objective.b_.squaredNorm());
  const double weight = energy > 0.0 ? 1.0 / std::sqrt(energy) : 1.0;
  objective.weighted_A_ = weight * objective.A_;
  objective.weighted_b_ = weight * objective.b_;
  objective.weighted_constant_ = weight * weight * objective.constant_;
  return objective;
}

double Objective::value(const Eigen::VectorXd& pi) const { return (A_ * pi - b_).squaredNorm() + constant_; }

double Objective::weighted_value(const Eigen::VectorXd& pi) const {
  return (weighted_A_ * pi - weighted_b_).squaredNorm() + weighted_constant_;
}

Eigen::VectorXd Objective::weighted_gradient(const Eigen::VectorXd& pi) const {
  return 2.0 * weighted_A_.transpose() * (weighted_A_ * pi - weighted_b_);
}

Eigen::VectorXd Objective::linear_unknowns(const Eigen::VectorXd& pi) const {
  if (unknowns_offset_.size() == 0) return {};
  return unknowns_offset_ - unknowns_of_pi_ * pi;
}

}  // namespace dynid
