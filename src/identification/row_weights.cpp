// SPDX-License-Identifier: Apache-2.0
#include "row_weights.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "dynid/base/statistics.hpp"

namespace dynid::detail {

RowWeights all_rows(const std::vector<RegressionRows>& rows) {
  RowWeights weights;
  for (const RegressionRows& r : rows) weights.emplace_back(Eigen::MatrixXd::Ones(r.size(), r.joints()));
  return weights;
}

RowWeights without(const std::vector<RegressionRows>& rows, const RowWeights& weights, int folds,
                   const std::function<bool(int)>& out) {
  RowWeights inside = weights;
  for (std::size_t l = 0; l < rows.size(); ++l) {
    const Eigen::Index size = rows[l].size(), margin = rows[l].overlap();
    for (Eigen::Index i = 0; i < size; ++i) {
      const Eigen::Index before = std::max<Eigen::Index>(0, i - margin),
                         after = std::min(size - 1, i + margin);
      for (Eigen::Index k : {before, i, after})
        if (out(static_cast<int>(k * folds / size))) inside[l].row(i).setZero();
    }
  }
  return inside;
}

RowWeights only(const std::vector<RegressionRows>& rows, const RowWeights& weights, int folds,
                const std::function<bool(int)>& out) {
  RowWeights outside = weights;
  for (std::size_t l = 0; l < rows.size(); ++l)
    for (Eigen::Index i = 0; i < rows[l].size(); ++i)
      if (!out(static_cast<int>(i * folds / rows[l].size()))) outside[l].row(i).setZero();
  return outside;
}

Eigen::Index rows_in(const RowWeights& weights, int j) {
  Eigen::Index rows = 0;
  for (const Eigen::MatrixXd& w : weights) rows += (w.col(j).array() != 0.0).count();
  return rows;
}

RowWeights huber_weights(const RowWeights& weights, const std::vector<Eigen::MatrixXd>& residuals) {
  RowWeights robust = weights;
  for (Eigen::Index j = 0; j < weights.front().cols(); ++j) {
    std::vector<double> size;
    for (std::size_t l = 0; l < residuals.size(); ++l)
      for (Eigen::Index i = 0; i < residuals[l].rows(); ++i)
        if (weights[l](i, j) != 0.0) size.push_back(std::abs(residuals[l](i, j)));
    const double limit = 1.345 * deviations_to_sigma * median(std::move(size));
    for (std::size_t l = 0; l < residuals.size(); ++l)
      for (Eigen::Index i = 0; i < residuals[l].rows(); ++i)
        if (std::abs(residuals[l](i, j)) > limit)
          robust[l](i, j) *= std::sqrt(limit / std::abs(residuals[l](i, j)));
  }
  return robust;
}

}  // namespace dynid::detail
