// SPDX-License-Identifier: Apache-2.0
#include "held_out.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "energy.hpp"
#include "split.hpp"

namespace dynid::detail {

Shrink shrink_of(const GapRows& rows, const Eigen::MatrixXd& after, const Eigen::VectorXd& floor,
                 unsigned seed) {
  Shrink shrink;
  shrink.before = rms(rows.y);
  shrink.after = rms(after);
  shrink.floor = floor;
  shrink.fraction = shrink_fraction(rows.y, after, floor);
  // Blocks drawn with replacement.
  std::vector<std::vector<Eigen::Index>> blocks;
  const double length = block_length(rows);
  double open = -1.0;
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    const double block = std::floor(rows.t[i] / length) + 1e6 * rows.log[static_cast<std::size_t>(i)];
    if (block != open) blocks.emplace_back();
    open = block;
    blocks.back().push_back(i);
  }
  std::mt19937_64 random(seed);
  std::vector<double> fractions;
  for (int k = 0; k < 200; ++k) {
    std::vector<Eigen::Index> drawn;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const auto& block = blocks[random() % blocks.size()];
      drawn.insert(drawn.end(), block.begin(), block.end());
    }
    fractions.push_back(shrink_fraction(rows.y(drawn, Eigen::all), after(drawn, Eigen::all), floor));
  }
  std::sort(fractions.begin(), fractions.end());
  shrink.low = std::min(shrink.fraction, fractions[10]);
  shrink.high = std::max(shrink.fraction, fractions[189]);
  return shrink;
}

GapModel fitted_within(const GapRows& rows, const GapModel& model) {
  const GapRows odd(rows, alternate(rows, true, within_length(rows), 1));
  GapModel part = model;
  part.effects = carried(odd, model.effects);
  part.fit = fit_of(odd, part.effects, model.kappa);
  return part;
}

Shrink shrink_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor,
                     unsigned seed) {
  const GapRows even(rows, alternate(rows, false, within_length(rows), 1));
  const GapModel part = fitted_within(rows, model);
  return shrink_of(even, even.y - contribution(even, part, part.fit.theta), floor, seed);
}

}  // namespace dynid::detail
