// SPDX-License-Identifier: Apache-2.0
#include "energy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alike.hpp"
#include "split.hpp"

namespace dynid::detail {

Eigen::VectorXd rms(const Eigen::MatrixXd& x) {
  return (x.colwise().squaredNorm() / double(std::max<Eigen::Index>(1, x.rows()))).cwiseSqrt().transpose();
}

double energy(const Eigen::MatrixXd& x, const Eigen::VectorXd& floor) {
  return (x * floor.cwiseInverse().asDiagonal()).squaredNorm() / double(std::max<Eigen::Index>(1, x.rows()));
}

double shrink_fraction(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
                       const Eigen::VectorXd& floor) {
  // Joint by joint: one that is quieter than its floor does not make up for the gap of another.
  const auto beyond = [&](const Eigen::MatrixXd& x) {
    return (rms(x).array() / floor.array()).square().cwiseMax(1.0).sum() - double(floor.size());
  };
  const double b = beyond(before);
  return b > 0.0 ? std::min(1.0, 1.0 - beyond(after) / b) : 0.0;
}

bool worse(const GapRows& rows, const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
           const Eigen::VectorXd& floor) {
  const double noise = double(floor.size()), length = block_length(rows);
  double sum = 0.0;
  for (Eigen::Index from = 0, to = 0; from < rows.size(); from = to) {
    const auto block = [&](Eigen::Index i) {
      return std::pair{rows.log[static_cast<std::size_t>(i)], std::floor(rows.t[i] / length)};
    };
    while (to < rows.size() && block(to) == block(from)) ++to;
    sum += std::log((energy(after.middleRows(from, to - from), floor) + noise) /
                    (energy(before.middleRows(from, to - from), floor) + noise));
  }
  return sum > 0.0;
}

Eigen::VectorXd carried_load(const GapRows& rows, const Criteria& criteria) {
  const Eigen::VectorXd load = rms(rows.load);
  return load.cwiseMax(criteria.least_load * largest_alike(rows.motions().front().robot(), load));
}

bool left_over(const GapRows& rows, const Eigen::MatrixXd& residual, double tolerance,
               const Criteria& criteria) {
  return (rms(residual).array() >
          (criteria.left_over * rows.coloured_floor + tolerance * carried_load(rows, criteria)).array())
      .any();
}

}  // namespace dynid::detail
