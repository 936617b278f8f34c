// SPDX-License-Identifier: Apache-2.0
#include "shares.hpp"

#include <algorithm>
#include <cmath>

#include "energy.hpp"

namespace dynid::detail {

std::vector<double> shapley_shares(const Search& search, const GapModel& model,
                                   const Eigen::VectorXd& floor) {
  const std::size_t count = model.effects.size(), subsets = std::size_t{1} << count;
  std::vector<double> explained(subsets, 0.0), shares(count, 0.0);
  const double before = energy(search.rows().y, floor);
  for (std::size_t subset = 1; subset < subsets; ++subset) {
    std::vector<Adopted> effects;
    for (std::size_t k = 0; k < count; ++k)
      if ((subset >> k & 1U) != 0) effects.push_back(model.effects[k]);
    // Alone, an effect may be fitted to what another makes, by weights that are not the energy's.
    explained[subset] =
        std::max(0.0, before - energy(search.evaluate(std::move(effects), model.kappa).fit.left, floor));
  }
  const auto factorial = [](std::size_t k) { return std::tgamma(double(k) + 1.0); };
  double sum = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t subset = 0; subset < subsets; ++subset) {
      if ((subset >> k & 1U) != 0) continue;
      std::size_t size = 0;
      for (std::size_t i = 0; i < count; ++i) size += subset >> i & 1U;
      shares[k] += factorial(size) * factorial(count - size - 1) / factorial(count) *
                   (explained[subset | std::size_t{1} << k] - explained[subset]);
    }
    shares[k] = std::max(0.0, shares[k]);
    sum += shares[k];
  }
  for (double& share : shares) share = sum > 0.0 ? share / sum : 0.0;
  return shares;
}

}  // namespace dynid::detail
