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
    bool scaled = true;  // what is other is a multiple
    for (int j = 0; j < logs[l].joints(); ++j) {
      if (logs[l].tau.col(j).maxCoeff() == logs[l].tau.col(j).minCoeff()) dead.push_back(j + 1);
      double speed = 0.0, mismatch = 0.0, logged_speed = 0.0, along = 0.0;
      for (const Segment& s : prepared[l].segments) {
        const Eigen::VectorXd rate = differentiate(s.q.col(j), s.rate);
        speed += rate.squaredNorm();
        Eigen::MatrixXd logged = s.speed.col(j);
        ZeroPhaseButterworth(prepared[l].cutoff, s.rate).apply(logged);
        mismatch += (logged - rate).squaredNorm();
        logged_speed += logged.squaredNorm();
        along += rate.dot(logged.col(0));
      }
      double samples = 0.0;
      for (const Segment& s : prepared[l].segments) samples += double(s.t.size());
      const double moving = part_moving * scales[static_cast<std::size_t>(j)].speed;
      if (speed < moving * moving * samples) continue;
      if (mismatch > largest_mismatch * largest_mismatch * speed) {
        other.push_back(j + 1);
        scaled = scaled &&
                 logged_speed - along * along / speed < largest_mismatch * largest_mismatch * logged_speed;
      }
      worst = std::max(worst, std::sqrt(mismatch / speed));
    }
    if (!dead.empty())
      out.push_back({"torque_missing", dead, double(dead.size()), "1",
                     logs[l].source + ": a torque channel never changes"});
    if (!other.empty())
      out.push_back({"velocity_mismatch", other, worst, "1",
                     logs[l].source + ": the velocity is not that of the positions (" +
                         (scaled ? "another unit?" : "does the joint shake faster than the log is sampled?") +
                         ")"});
  }
  return out;
}

std::vector<DataIssue> too_short(const GapRows& rows, const Split& split, const std::string& source,
                                 int logs) {
  const auto fit = std::count(split.to_fit.begin(), split.to_fit.end(), true),
             judge = std::count(split.to_judge.begin(), split.to_judge.end(), true);
  if (fit >= least_to_fit && judge >= least_to_judge) return {};
  // In proportion to what is there, and what a log loses to the filter at its ends.
  const double lacking = std::max(double(least_to_fit) / double(std::max<std::ptrdiff_t>(fit, 1)),
                                  double(least_to_judge) / double(std::max<std::ptrdiff_t>(judge, 1)));
  const double seconds = rows.period() * double(rows.size()) / double(logs);
  const double more = std::ceil(seconds * (lacking - 1.0) + 1.0);
  const std::string text =
      (logs > 1 ? "the logs (" + source + ", ...) have " : source + " has ") + std::to_string(fit) +
      " independent rows to choose effects by and " + std::to_string(judge) + " to judge them by, where " +
      std::to_string(least_to_fit) + " and " + std::to_string(least_to_judge) +
      " are needed: " + std::to_string(int(more)) + " s more of motion" + (logs > 1 ? " in each" : "");
  return {{"too_short", {}, double(std::min(fit, judge)), "1", text}};
}

}  // namespace dynid::detail
