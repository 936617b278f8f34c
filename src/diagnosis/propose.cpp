// SPDX-License-Identifier: Apache-2.0
#include "propose.hpp"

namespace dynid::detail {

Adopted propose(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base, bool refine,
                double worth) {
  if (grid.empty()) return {&h, {}, 0.0};  // a pair, of a robot with one joint
  if (h.scope() == Scope::window) return propose_window(by, h, grid, base, worth);
  if (own_channel(h, *grid[0][0].block)) return propose_own(by, h, grid, base, refine);
  return propose_coupled(by, h, grid, base, refine);
}

}  // namespace dynid::detail
