// SPDX-License-Identifier: Apache-2.0
#include "split.hpp"

#include <algorithm>

#include "energy.hpp"
#include "fit.hpp"

namespace dynid::detail {
namespace {

constexpr Eigen::Index guard = 4;  // rows: what the filter spreads

/// There is a gap in the rows, beyond what an inexact nominal leaves.
bool has_gap(const GapRows& everything, const std::vector<bool>& mine, double tolerance,
             const Criteria& criteria) {
  const GapRows rows(everything, mine);
  return left_over(rows, fit_terms(rows, rows.y, {}, tolerance).residual, tolerance, criteria);
}

/// All but the last log to fit, the last to judge.
void by_log(const GapRows& rows, int logs, Split& out) {
  out.to_fit.resize(static_cast<std::size_t>(rows.size()));
  out.to_judge = out.to_fit;
  for (std::size_t i = 0; i < out.to_fit.size(); ++i) {
    out.to_judge[i] = rows.log[i] + 1 == logs;
    out.to_fit[i] = !out.to_judge[i];
  }
}

void by_blocks(const GapRows& rows, Split& out) {
  const double block = block_length(rows);
  out.to_fit = alternate(rows, out.odd_fit, block, guard);
  out.to_judge = alternate(rows, !out.odd_fit, block, guard);
}

}  // namespace

std::vector<bool> alternate(const GapRows& rows, bool odd, double seconds, Eigen::Index apart) {
  std::vector<bool> keep(static_cast<std::size_t>(rows.size()));
  const auto mine = [&](Eigen::Index i) { return (static_cast<long>(rows.t[i] / seconds) % 2 == 1) == odd; };
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    bool inside = mine(i);
    for (Eigen::Index k = std::max<Eigen::Index>(0, i - apart);
         inside && k <= std::min(rows.size() - 1, i + apart); ++k)
      inside = mine(k);
    keep[static_cast<std::size_t>(i)] = inside;
  }
  return keep;
}

Split split(const GapRows& rows, int logs, double tolerance, const Criteria& criteria) {
  Split out;
  out.several = logs > 1;
  if (!out.several) {
    by_blocks(rows, out);
    const auto gap = [&](const std::vector<bool>& mine) {
      std::vector<Eigen::Index> where;
      for (Eigen::Index i = 0; i < rows.size(); ++i)
        if (mine[static_cast<std::size_t>(i)]) where.push_back(i);
      return energy(rows.y(where, Eigen::all), rows.white_floor);
    };
    out.odd_fit = gap(out.to_judge) > gap(out.to_fit);
    if (out.odd_fit) by_blocks(rows, out);
    return out;
  }
  by_log(rows, logs, out);
  const bool in_first = has_gap(rows, out.to_fit, tolerance, criteria),
             in_last = has_gap(rows, out.to_judge, tolerance, criteria);
  out.alone = in_first != in_last;
  if (in_last && !in_first) std::swap(out.to_fit, out.to_judge);
  return out;
}

Split over_all(const GapRows& rows, int logs, const GapRows& windows, const Split& of_windows) {
  Split out = of_windows;
  if (!out.several) {
    by_blocks(rows, out);
    return out;
  }
  by_log(rows, logs, out);
  for (std::size_t i = 0; i < of_windows.to_judge.size(); ++i) {
    if (!of_windows.to_judge[i]) continue;
    if (windows.log[i] + 1 != logs) std::swap(out.to_fit, out.to_judge);
    break;
  }
  return out;
}

}  // namespace dynid::detail
