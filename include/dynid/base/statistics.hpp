// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace dynid {

// Robust statistics of samples. Each takes its samples by value, and orders them; none may be NaN.

/// Times the median of absolute deviations: the standard deviation, where they are normal.
constexpr double deviations_to_sigma = 1.4826;

/// Half of the samples are not above it: the upper one of the two in the middle where their number is even; 0
/// of none.
inline double median(std::vector<double> x) {
  if (x.empty()) return 0.0;
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

/// The same of a column, a row or an expression.
template <class Derived>
double median(const Eigen::DenseBase<Derived>& x) {
  std::vector<double> copy(static_cast<std::size_t>(x.size()));
  for (Eigen::Index k = 0; k < x.size(); ++k) copy[static_cast<std::size_t>(k)] = x.derived().coeff(k);
  return median(std::move(copy));
}

/// Of every column.
inline Eigen::VectorXd column_medians(const Eigen::MatrixXd& x) {
  Eigen::VectorXd out(x.cols());
  for (Eigen::Index j = 0; j < x.cols(); ++j) out[j] = median(x.col(j));
  return out;
}

/// A sample that counts `weight` times.
struct WeightedSample {
  double value, weight;
};

/// The least sample that `part` (0 to 1) of the weight is not above; 0 of none.
inline double quantile(std::vector<WeightedSample> x, double part) {
  if (x.empty()) return 0.0;
  std::sort(x.begin(), x.end(),
            [](const WeightedSample& a, const WeightedSample& b) { return a.value < b.value; });
  double whole = 0.0, seen = 0.0;
  for (const WeightedSample& w : x) whole += w.weight;
  const double enough = part * whole - 1e-9;  // a sum of weights is rounded
  for (const WeightedSample& w : x) {
    seen += w.weight;
    if (seen >= enough) return w.value;
  }
  return x.back().value;
}

}  // namespace dynid
