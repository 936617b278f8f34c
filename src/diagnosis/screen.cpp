// SPDX-License-Identifier: Apache-2.0
#include "screen.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dynid::detail {
namespace {

constexpr double least_new = 1e-6;  // of a column's energy: less is lost in single precision

/// sum over rows t that have a past of x_{t-a}^T x_{t-b}, for a <= b, one above the other.
Eigen::MatrixXd lagged_products(const GapRows& rows, const Eigen::MatrixXd& x) {
  constexpr Eigen::Index lags = noise_order;
  const Eigen::Index p = x.cols();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero((lags + 1) * (lags + 2) / 2 * p, p);
  for (std::size_t k = 0; k + 1 < rows.parts.size(); ++k) {
    const Eigen::Index first = rows.parts[k] + lags, count = rows.parts[k + 1] - first;
    if (count <= 0) continue;
    Eigen::Index at = 0;
    for (Eigen::Index a = 0; a <= lags; ++a)
      for (Eigen::Index b = a; b <= lags; ++b, at += p)
        out.middleRows(at, p).noalias() +=
            x.middleRows(first - a, count).transpose() * x.middleRows(first - b, count);
  }
  return out;
}

/// x^T x of whitened columns x, from their lagged products.
Eigen::MatrixXd whitened_product(const Eigen::MatrixXd& lagged, const ChannelNoise& noise) {
  constexpr Eigen::Index lags = noise_order;
  const Eigen::Index p = lagged.cols();
  const auto weight = [&](Eigen::Index a) { return a == 0 ? 1.0 : -noise.ar[a - 1]; };
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(p, p);
  Eigen::Index at = 0;
  for (Eigen::Index a = 0; a <= lags; ++a)
    for (Eigen::Index b = a; b <= lags; ++b, at += p) {
      const auto here = lagged.middleRows(at, p);
      const double w = weight(a) * weight(b) / noise.variance;
      if (a == b)
        out += w * here;
      else
        out += w * (here + here.transpose());
    }
  return out;
}

/// A base in the form that a screen needs: what is multiplied with its columns.
struct Seen {
  Eigen::MatrixXd with;               ///< rows x (p + 1 + nuisance): see seen_by()
  Eigen::LDLT<Eigen::MatrixXd> ldlt;  ///< of the base's own p columns
  Eigen::VectorXd scale;              ///< of these
  double left;                        ///< energy of the gap beside these
};

/// For unwhitened columns c, with^T c is [base^T P c; y^T P c; L^-1 N^T c], all of whitened columns, where P
/// takes the nuisance N out and L L^T = I + N^T N.
Seen seen_by(const GapRows& rows, const SeenChannel& base) {
  const Eigen::Index p = base.gram.cols() - 1, m = base.by.nuisance.cols();
  Eigen::MatrixXd white(base.white.rows(), p + 1 + m);
  white.leftCols(p + 1) = base.white;
  white.leftCols(p + 1).noalias() -= base.by.nuisance * base.taken;
  white.rightCols(m) = base.by.llt.matrixL().solve(base.by.nuisance.transpose()).transpose();
  Seen out;
  out.with = whitened_back(rows, white, base.by.noise);
  out.left = base.gram(p, p);
  if (p == 0) return out;
  out.scale = (base.gram.diagonal().head(p).array() + 1e-300).sqrt().inverse();
  Eigen::MatrixXd G = out.scale.asDiagonal() * base.gram.topLeftCorner(p, p) * out.scale.asDiagonal();
  G.diagonal().array() += 1e-10;
  out.ldlt.compute(G);
  const Eigen::VectorXd h = out.scale.asDiagonal() * base.gram.topRightCorner(p, 1);
  out.left -= h.dot(out.ldlt.solve(h));
  return out;
}

/// Energy of the gap that a block takes beside the base. `seen`: what the base is multiplied with, times the
/// block's columns; `own`: x^T x of these, whitened.
double taken_by(const Seen& base, const SeenChannel& channel, const Eigen::MatrixXd& seen,
                Eigen::MatrixXd own) {
  const Eigen::Index p = base.scale.size(), m = seen.rows() - p - 1;
  const Eigen::VectorXd energy = own.diagonal();
  own.noalias() -= seen.bottomRows(m).transpose() * seen.bottomRows(m);
  Eigen::VectorXd h = seen.row(p).transpose();
  if (p > 0) {
    const Eigen::MatrixXd cross = base.scale.asDiagonal() * seen.topRows(p);
    const Eigen::MatrixXd by_base = base.ldlt.solve(cross);
    own.noalias() -= cross.transpose() * by_base;
    h.noalias() -= by_base.transpose() * (base.scale.asDiagonal() * channel.gram.topRightCorner(p, 1));
  }
  own.diagonal() = own.diagonal().cwiseMax(0.0) + least_new * energy;
  return h.dot(solve(own, h, nullptr));
}

}  // namespace

Screen::Screen(const GapRows& rows, int joint, const std::vector<const RowBlock*>& blocks) {
  first_.push_back(0);
  for (const RowBlock* block : blocks) first_.push_back(first_.back() + block->size());
  columns_.resize(rows.size(), first_.back());
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Eigen::MatrixXd& values = *blocks[k]->find(joint);
    columns_.middleCols(first_[k], values.cols()) = values.cast<float>();
    lagged_.push_back(lagged_products(rows, values));
  }
}

std::vector<double> Screen::gains(const GapRows& rows, int joint,
                                  const std::vector<SeenChannel>& base) const {
  std::vector<double> out(lagged_.size(), -std::numeric_limits<double>::infinity());
  for (const SeenChannel& channel : base) {
    const Seen by = seen_by(rows, channel);
    const Eigen::MatrixXf seen = by.with.cast<float>().transpose() * columns_;
    for (std::size_t k = 0; k < out.size(); ++k) {
      const double taken =
          taken_by(by, channel, seen.middleCols(first_[k], first_[k + 1] - first_[k]).cast<double>().eval(),
                   whitened_product(lagged_[k], channel.by.noise));
      const double left = std::max(by.left - taken, 1e-12 * channel.gram.bottomRightCorner(1, 1).value());
      out[k] = std::max(out[k], 0.5 * rows.active[joint] * std::log((by.left + 1e-300) / (left + 1e-300)));
    }
  }
  return out;
}

}  // namespace dynid::detail
