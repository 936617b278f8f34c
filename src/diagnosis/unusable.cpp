// SPDX-License-Identifier: Apache-2.0
#include "unusable.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "dynid/signal/filter.hpp"

namespace dynid::detail {

std::vector<DataIssue> unusable(const std::vector<Log>& logs, const std::vector<PreparedLog>& prepared,
                                const std::vector<JointScale>& scales) {
  constexpr double part_moving = 0.01;      // of the joint's speed: one slower than that (rms) rests
  constexpr double largest_mismatch = 0.5;  // of the velocity
  std::vector<DataIssue> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    std::vector<int> dead, other;
    double worst = 0.0;
    for (int j = 0; j < logs[l].joints(); ++j) {
      if (logs[l].tau.col(j).maxCoeff() == logs[l].tau.col(j).minCoeff()) dead.push_back(j + 1);
      double speed = 0.0, mismatch = 0.0;
      for (const Segment& s : prepared[l].segments) {
        const Eigen::VectorXd rate = differentiate(s.q.col(j), s.rate);
        speed += rate.squaredNorm();
        Eigen::MatrixXd logged = s.speed.col(j);
        ZeroPhaseButterworth(prepared[l].cutoff, s.rate).apply(logged);
        mismatch += (logged - rate).squaredNorm();
      }
      double samples = 0.0;
      for (const Segment& s : prepared[l].segments) samples += double(s.t.size());
      const double moving = part_moving * scales[static_cast<std::size_t>(j)].speed;
      if (speed < moving * moving * samples) continue;
      if (mismatch > largest_mismatch * largest_mismatch * speed) other.push_back(j + 1);
      worst = std::max(worst, std::sqrt(mismatch / speed));
    }
    if (!dead.empty())
      out.push_back({"torque_missing", dead, double(dead.size()), "1",
                     logs[l].source + ": a torque channel never changes"});
    if (!other.empty())
      out.push_back({"velocity_mismatch", other, worst, "1",
                     logs[l].source + ": the velocity is not that of the positions (another unit?)"});
  }
  return out;
}

}  // namespace dynid::detail
