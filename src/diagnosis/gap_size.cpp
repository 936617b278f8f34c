// SPDX-License-Identifier: Apache-2.0
#include "gap_size.hpp"

#include <algorithm>
#include <cmath>

#include "energy.hpp"

namespace dynid::detail {
namespace {

constexpr double normal_95 = 1.6449;
constexpr Eigen::Index most_lags = 400;  // rows: what is correlated for longer is not noise

/// Independent rows that a joint's mean square rests on.
double degrees_of_freedom(const GapRows& rows, int joint) {
  const Eigen::VectorXd& x = rows.y.col(joint);
  const Eigen::Index longest = std::min(rows.size() / 4, most_lags);
  double own = x.squaredNorm() + 1e-300, sum = 0.0;
  for (Eigen::Index lag = 1; lag < longest; ++lag) {
    double product = 0.0;
    for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
      const Eigen::Index size = rows.parts[p + 1] - rows.parts[p] - lag;
      if (size > 0) product += x.segment(rows.parts[p], size).dot(x.segment(rows.parts[p] + lag, size));
    }
    sum += (product / own) * (product / own);
  }
  return std::max(2.0, rows.active[joint] / (1.0 + 2.0 * sum));
}

/// Chi-squared over its degrees of freedom, and a standard normal variable (Wilson and Hilferty 1931).
double chi_squared_at(double normal, double freedom) {
  const double spread = 2.0 / (9.0 * freedom);
  return std::pow(std::max(1e-3, 1.0 - spread + normal * std::sqrt(spread)), 3);
}
double normal_at(double ratio, double freedom) {
  const double spread = 2.0 / (9.0 * freedom);
  return (std::cbrt(ratio) - 1.0 + spread) / std::sqrt(spread);
}

}  // namespace

GapSize gap_size(const GapRows& rows, const Eigen::VectorXd& floor, double tolerance,
                 const Criteria& criteria) {
  const int n = rows.joints();
  GapSize out;
  out.tolerance = tolerance * carried_load(rows, criteria);
  out.upper.resize(n);
  double least = 1.0;
  for (int j = 0; j < n; ++j) {
    const double freedom = degrees_of_freedom(rows, j), square = rows.y.col(j).squaredNorm() / rows.active[j];
    const double most = square / chi_squared_at(-normal_95, freedom);
    out.upper[j] = std::sqrt(std::max(0.0, most - std::pow(floor[j], 2)));
    const double allowed = std::pow(out.tolerance[j], 2) + std::pow(floor[j], 2);
    least = std::min(least, 0.5 * std::erfc(normal_at(square / allowed, freedom) / std::sqrt(2.0)));
  }
  out.p_value = -std::expm1(double(n) * std::log1p(-std::min(least, 1.0 - 1e-15)));
  return out;
}

}  // namespace dynid::detail
