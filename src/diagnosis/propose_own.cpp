// SPDX-License-Identifier: Apache-2.0
// An effect that each joint has in its own torque: joint by joint.
#include <tbb/parallel_for.h>

#include "propose.hpp"

namespace dynid::detail {

Adopted propose_own(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                    bool refine) {
  struct OnJoint {
    UnitShape unit;
    double gained = 0.0;
    bool taken = false;
  };
  std::vector<OnJoint> joints(grid.size());
  tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t u) {
    const Channel& channel = base.channels[u];
    const double worth =
        !refine ? std::numeric_limits<double>::infinity()
                : by.criteria.worth_refining *
                      (by.price(h, {static_cast<int>(u), grid[u].points[0].shape, grid[u].points[0].block}) +
                       by.criteria.joint_gain);
    const UnitShape unit =
        best_own_shape(by, h, static_cast<int>(u), grid[u], channel, base.model.kappa, worth);
    const double gained =
        by.own_gain(h, unit.unit, *unit.block, channel, base.model.kappa) - by.price(h, unit);
    if (gained < by.criteria.joint_gain) return;
    Eigen::VectorXd c = Eigen::VectorXd::Ones(1);
    if (!h.shape_only())
      c = fit_channel(by.rows, static_cast<int>(u), channel.y, beside(channel.columns, unit.block->values[0]),
                      base.model.kappa)
              .theta.tail(unit.block->size());
    joints[u] = {unit, gained, by.plausible(h, unit.unit, c, unit.shape)};
  });
  Adopted effect{&h, {}, 0.0};
  for (const OnJoint& here : joints) {
    if (!here.taken) continue;
    effect.units.push_back(here.unit);
    effect.gain += here.gained;
  }
  return effect;
}

}  // namespace dynid::detail
