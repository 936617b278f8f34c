// SPDX-License-Identifier: Apache-2.0
#include "joint_shrink.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "dynid/base/statistics.hpp"
#include "split.hpp"

namespace dynid::detail {
namespace {

constexpr int draws = 200;
constexpr double least_gap = 2.0;  // of the floor's energy: a joint with less has no gap that could shrink

/// Rows of one block, and the energy of the gap in it: n each.
struct JointEnergy {
  double rows = 0.0;
  Eigen::VectorXd before, after;

  explicit JointEnergy(Eigen::Index n) : before(Eigen::VectorXd::Zero(n)), after(before) {}
  void add(const JointEnergy& other) {
    rows += other.rows;
    before += other.before;
    after += other.after;
  }
  double fraction(Eigen::Index joint, double floor) const {
    const double noise = floor * floor, excess = before[joint] / rows - noise;
    return excess > 0.0 ? std::min(1.0, 1.0 - (after[joint] / rows - noise) / excess) : 0.0;
  }
};

std::vector<JointEnergy> held_out_blocks(const GapSeries& s, Eigen::Index n) {
  std::vector<JointEnergy> blocks;
  int log = -1;
  double block = -1.0;
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < s.t.size(); ++i)
    if (s.t[i] > s.t[i - 1]) steps.push_back(s.t[i] - s.t[i - 1]);
  const double length = steps.empty() ? 1.0 : block_rows * median(std::move(steps));
  for (Eigen::Index i = 0; i < s.t.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!s.held_out[k]) continue;
    const double here = std::floor(s.t[i] / length);
    if (blocks.empty() || here != block || s.log[k] != log) blocks.emplace_back(n);
    block = here, log = s.log[k];
    blocks.back().rows += 1.0;
    blocks.back().before += s.before.row(i).cwiseAbs2().transpose();
    blocks.back().after += s.after.row(i).cwiseAbs2().transpose();
  }
  return blocks;
}

}  // namespace

JointShrink joint_shrink(const GapSeries& series, const Eigen::VectorXd& floor, unsigned seed) {
  const Eigen::Index n = floor.size();
  JointShrink out;
  out.before = out.after = Eigen::VectorXd::Zero(n);
  out.fraction = out.low = out.high = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  const std::vector<JointEnergy> blocks = held_out_blocks(series, n);
  if (blocks.empty()) return out;
  JointEnergy all(n);
  for (const JointEnergy& block : blocks) all.add(block);
  out.before = (all.before / all.rows).cwiseSqrt();
  out.after = (all.after / all.rows).cwiseSqrt();
  std::mt19937_64 random(seed);
  Eigen::MatrixXd drawn(draws, n);  // blocks with replacement
  for (int k = 0; k < draws; ++k) {
    JointEnergy sum(n);
    for (std::size_t b = 0; b < blocks.size(); ++b) sum.add(blocks[random() % blocks.size()]);
    for (Eigen::Index j = 0; j < n; ++j) drawn(k, j) = sum.fraction(j, floor[j]);
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    if (!(all.before[j] > least_gap * floor[j] * floor[j] * all.rows)) continue;
    Eigen::VectorXd x = drawn.col(j);
    std::sort(x.data(), x.data() + x.size());
    out.fraction[j] = all.fraction(j, floor[j]);
    out.low[j] = std::min(out.fraction[j], x[draws / 20]);
    out.high[j] = std::max(out.fraction[j], x[draws - 1 - draws / 20]);
  }
  return out;
}

}  // namespace dynid::detail
