// SPDX-License-Identifier: Apache-2.0
// An effect that each joint has in its own torque: joint by joint.
#include "propose.hpp"

namespace dynid::detail {

Adopted propose_own(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                    bool refine) {
  Adopted effect{&h, {}, 0.0};
  for (std::size_t u = 0; u < grid.size(); ++u) {
    const Channel& channel = base.channels[u];
    const double worth = !refine
                             ? std::numeric_limits<double>::infinity()
                             : by.criteria.worth_refining *
                                   (by.price(h, {static_cast<int>(u), grid[u][0].shape, grid[u][0].block}) +
                                    by.criteria.joint_gain);
    const UnitShape unit =
        best_own_shape(by, h, static_cast<int>(u), grid[u], channel, base.model.kappa, worth);
    const double gained =
        by.own_gain(h, unit.unit, *unit.block, channel, base.model.kappa) - by.price(h, unit);
    if (gained < by.criteria.joint_gain) continue;
    Eigen::VectorXd c = Eigen::VectorXd::Ones(1);
    if (!h.shape_only())
      c = fit_channel(by.rows, static_cast<int>(u), channel.y, beside(channel.columns, unit.block->values[0]),
                      base.model.kappa)
              .theta.tail(unit.block->size());
    if (!by.plausible(h, unit.unit, c, unit.shape)) continue;
    effect.units.push_back(unit);
    effect.gain += gained;
  }
  return effect;
}

}  // namespace dynid::detail
