// SPDX-License-Identifier: Apache-2.0
#include "gap_test.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace dynid::detail {
namespace {

/// The lower half of the band: binomial weights of nine rows, within each part.
Eigen::MatrixXd lower_half(const GapRows& rows, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd y = x;
  for (int pass = 0; pass < 4; ++pass) {
    const Eigen::MatrixXd before = y;
    for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
      const Eigen::Index first = rows.parts[p], last = rows.parts[p + 1] - 1;
      for (Eigen::Index i = first; i <= last; ++i)
        y.row(i) = 0.25 * before.row(std::max(first, i - 1)) + 0.5 * before.row(i) +
                   0.25 * before.row(std::min(last, i + 1));
    }
  }
  return y;
}

}  // namespace

double structure_p_value(const GapRows& rows, const std::vector<const RowBlock*>& blocks,
                         const Eigen::MatrixXd& gap, const std::vector<Eigen::MatrixXd>& surrogates) {
  const Eigen::VectorXd scale =
      (gap.colwise().squaredNorm().array() / double(gap.rows()) + 1e-18).rsqrt().transpose();
  const auto count = static_cast<Eigen::Index>(surrogates.size());
  // Column 0: the gap itself; then the surrogates.
  std::vector<Eigen::MatrixXd> signals;
  for (int j = 0; j < rows.joints(); ++j) {
    Eigen::MatrixXd x(gap.rows(), count + 1);
    x.col(0) = scale[j] * gap.col(j);
    for (Eigen::Index k = 0; k < count; ++k)
      x.col(k + 1) = scale[j] * surrogates[static_cast<std::size_t>(k)].col(j);
    signals.push_back(lower_half(rows, x));
  }
  Eigen::MatrixXd statistic(static_cast<Eigen::Index>(blocks.size()), count + 1);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
    const RowBlock& block = *blocks[b];
    const Eigen::Index p = block.size();
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(p, p), h = Eigen::MatrixXd::Zero(p, count + 1);
    for (std::size_t c = 0; c < block.channels.size(); ++c) {
      const auto j = static_cast<std::size_t>(block.channels[c]);
      const Eigen::MatrixXd columns = scale[block.channels[c]] * lower_half(rows, block.values[c]);
      G.noalias() += columns.transpose() * columns;
      h.noalias() += columns.transpose() * signals[j];
    }
    G.diagonal().array() += 1e-9 * G.trace() / double(p) + 1e-300;
    Eigen::VectorXd explained = h.cwiseProduct(G.ldlt().solve(h)).colwise().sum().transpose();
    // The gap is one of them here: only then is it, without an effect, no more likely the largest than
    // another.
    const double mean = explained.mean();
    const double deviation = std::sqrt((explained.array() - mean).square().mean()) + 1e-12;
    statistic.row(static_cast<Eigen::Index>(b)) = ((explained.array() - mean) / deviation).transpose();
  });
  const Eigen::VectorXd most = statistic.colwise().maxCoeff().transpose();
  return double(1 + (most.tail(count).array() >= most[0]).count()) / double(count + 1);
}

}  // namespace dynid::detail
