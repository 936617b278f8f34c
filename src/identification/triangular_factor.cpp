// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/triangular_factor.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

TriangularFactor::TriangularFactor(int columns)
    : columns_(columns), factor_(Eigen::MatrixXd::Zero(columns + 1, columns + 1)) {}

void TriangularFactor::add(const Eigen::Ref<const Eigen::MatrixXd>& block) {
  const Eigen::Index width = columns_ + 1;
  if (block.cols() != width)
    throw Error("regression rows of " + std::to_string(block.cols() - 1) + " coefficients for a factor of " +
                std::to_string(columns_));
  const Eigen::Index most = 4 * width;  // tall enough for level-3 speed, small enough for the cache
  Eigen::MatrixXd stack;
  for (Eigen::Index first = 0; first < block.rows(); first += most) {
    const Eigen::Index count = std::min(most, block.rows() - first);
    stack.resize(width + count, width);
    stack.topRows(width) = factor_;
    stack.bottomRows(count) = block.middleRows(first, count);
    const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(stack);
    factor_ = stack.topRows(width).triangularView<Eigen::Upper>();
  }
  rows_ += block.rows();
}

void TriangularFactor::merge(const TriangularFactor& other, double weight) {
  const Eigen::Index rows = rows_ + other.rows_;
  add(weight * other.factor_);
  rows_ = rows;
}

TriangularFactor TriangularFactor::scattered(const std::vector<int>& where, int columns) const {
  TriangularFactor out(columns);
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(columns_ + 1, columns + 1);
  for (int k = 0; k < columns_; ++k) block.col(where[static_cast<std::size_t>(k)]) = factor_.col(k);
  block.col(columns) = factor_.col(columns_);
  out.add(block);
  out.rows_ = rows_;
  return out;
}

TriangularFactor TriangularFactor::restricted(const std::vector<int>& kept) const {
  TriangularFactor out(static_cast<int>(kept.size()));
  Eigen::MatrixXd block(columns_ + 1, out.columns_ + 1);
  for (int k = 0; k < out.columns_; ++k) block.col(k) = factor_.col(kept[static_cast<std::size_t>(k)]);
  block.col(out.columns_) = factor_.col(columns_);
  out.add(block);
  out.rows_ = rows_;
  return out;
}

Eigen::MatrixXd TriangularFactor::R() const { return factor_.topLeftCorner(columns_, columns_); }
Eigen::VectorXd TriangularFactor::z() const { return factor_.topRightCorner(columns_, 1); }
double TriangularFactor::residual() const {
  return factor_(columns_, columns_) * factor_(columns_, columns_);
}
double TriangularFactor::energy() const { return factor_.col(columns_).squaredNorm(); }

}  // namespace dynid
