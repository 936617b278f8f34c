// SPDX-License-Identifier: Apache-2.0
// Units of velocities and stamps: what the kinematics say.
#include <cmath>

#include "conventions_search.hpp"

namespace dynid::detail {

using Eigen::Index;

VelocityReading compare_velocity(const SpreadRows& rows) {
  VelocityReading k;
  if (rows.logged_dq.size() == 0) {
    // A millisecond is the shortest step that joints are logged at; a second is none to log joints at.
    if (rows.interval >= 1e5)
      k.time_unit = 1e-9;
    else if (rows.interval >= 100.0)
      k.time_unit = 1e-6;
    k.before = k.time_unit == 1.0 ? 1.0 : 0.0;
    return k;
  }
  const double travel = (rows.q.colwise().maxCoeff() - rows.q.colwise().minCoeff()).maxCoeff();
  if (!(travel > 1e-9 * std::max(1.0, rows.q.cwiseAbs().maxCoeff()))) return k;  // it stands still
  const Eigen::VectorXd speed = rows.dq.colwise().squaredNorm().transpose();
  std::vector<double> factors;
  double energy = 0.0, apart = 0.0;
  int moving = 0, related = 0;
  for (int j = 0; j < rows.q.cols(); ++j) {
    const double own = speed[j], there = rows.logged_dq.col(j).squaredNorm(),
                 along = rows.logged_dq.col(j).dot(rows.dq.col(j));
    if (!(own > 0.01 * speed.maxCoeff())) continue;
    ++moving;
    energy += 1.0;
    apart += (rows.logged_dq.col(j) - rows.dq.col(j)).squaredNorm() / own;
    if (there > 0.0 && along * along > 0.7 * own * there) {
      ++related;
      factors.push_back(along / own);
    }
  }
  if (moving == 0) return k;
  k.before = 1.0 - apart / energy;
  if (2 * related < moving) {
    k.unrelated = true;
    return k;
  }
  std::sort(factors.begin(), factors.end());
  const double f = factors[factors.size() / 2];
  if (f > 1.0 / 1.5 && f < 1.5) return k;
  if (f > 0.0 && factors.front() > 0.0) {
    for (const double unit : {1e3, 1e6, 1e9}) {
      if (rows.interval >= 1e-4 * unit && std::abs(std::log(f / unit)) < 0.3) k.time_unit = 1.0 / unit;
      // Degrees a second beside stamps in another unit.
      if (rows.interval >= 1e-4 * unit && std::abs(std::log(f * degree_of_angle / unit)) < 0.3) {
        k.time_unit = 1.0 / unit;
        k.velocity_unit = degree_of_angle;
      }
    }
  }
  if (k.time_unit == 1.0) k.velocity_unit = 1.0 / f;
  double after = 0.0;
  for (int j = 0; j < rows.q.cols(); ++j) {
    if (!(speed[j] > 0.01 * speed.maxCoeff())) continue;
    const Eigen::VectorXd own = rows.dq.col(j) / k.time_unit, there = k.velocity_unit * rows.logged_dq.col(j);
    after += (own - there).squaredNorm() / own.squaredNorm();
  }
  k.after = 1.0 - after / energy;
  if (k.after < 0.5) k = {1.0, 1.0, true, k.before, 1.0};
  return k;
}

}  // namespace dynid::detail
