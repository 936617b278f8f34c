// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "search.hpp"

namespace dynid::detail {

std::vector<VisibleSize> Search::smallest_visible(const GapModel& none) const {
  std::vector<VisibleSize> out;
  const Base base = by_.base_of(none);
  for (std::size_t k = 0; k < library_.size(); ++k) {
    if (grids_[k].empty()) continue;
    const Hypothesis& h = *library_[k];
    const RowBlock& first = *grids_[k][0].points[0].block;
    if (h.shape_only() || h.once() || !own_channel(h, first) || first.size() != 1) continue;
    VisibleSize visible{h.name(), 0, 0.0};
    for (std::size_t u = 0; u < grids_[k].size(); ++u) {
      const Whitener& by = base.terms.by[1][u].by;
      double least = std::numeric_limits<double>::infinity();
      for (const GridPoint& point : grids_[k][u].points) {
        // Evidence grows by half of (coefficient / deviation)^2.
        const Eigen::MatrixXd& column = point.block->values[0];
        const double need =
            2.0 * (by_.price(h, {static_cast<int>(u), point.shape, point.block}) + by_.criteria.effect_gain);
        const Eigen::MatrixXd seen = whitened(by_.rows, column, by.noise);
        const Eigen::MatrixXd hidden = by.nuisance.transpose() * seen;
        const double information = seen.squaredNorm() - (hidden.transpose() * by.llt.solve(hidden)).value();
        const double size = std::sqrt(column.squaredNorm() / double(by_.rows.size()) * need / information);
        if (information > 0.0 && size < least) least = size;
      }
      if (least > visible.torque_rms && std::isfinite(least))
        visible = {h.name(), static_cast<int>(u) + 1, least};
    }
    out.push_back(visible);
  }
  return out;
}

}  // namespace dynid::detail
