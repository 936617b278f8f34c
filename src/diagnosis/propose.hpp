// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "evaluator.hpp"
#include "screen.hpp"

namespace dynid::detail {

/// The columns of one unit of an effect at one shape of its grid.
struct GridPoint {
  Eigen::VectorXd shape;
  std::shared_ptr<const RowBlock> block;
};
/// Of one unit.
struct UnitGrid {
  std::vector<GridPoint> points;
  std::shared_ptr<const Screen> screen;  ///< of the points; null where they are few, or fixed
};
using Grid = std::vector<UnitGrid>;
/// With what screens it, where that is worth while.
UnitGrid unit_grid(const GapRows& rows, const Hypothesis& h, int unit, std::vector<GridPoint> points);

constexpr std::size_t nearest_points = 3;  ///< of a grid: as many are fitted

/// Shapes of the grid of one unit of an effect.
std::vector<Eigen::VectorXd> grid_points(const GapRows& rows, const Hypothesis& h, int unit);

/// Of a grid the points that come nearest to being the best beside `base`, quickly told; units that do not
/// come near have none.
Grid nearest(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base);

/// The best form of one effect beside those of `base`: no units where there is none. The strategy follows
/// from the effect's scope: in each joint's own torque, in the torques of several joints, in a window of
/// time. A window is sought where it may gain `worth`; any other shape is refined between the points of its
/// grid where `refine` asks for it.
Adopted propose(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base, bool refine,
                double worth);
Adopted propose_own(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                    bool refine);
Adopted propose_coupled(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                        bool refine);
Adopted propose_window(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                       double worth);

/// Whether the base has the effect on this unit.
bool has(const Base& base, const Hypothesis& h, int unit);

/// Log evidence that a block adds.
using Gain = std::function<double(const RowBlock&)>;
/// The best point of the grid by `gain`, refined where it gains `worth`.
UnitShape best_shape(const Evaluator& by, const Hypothesis& h, int unit, const std::vector<GridPoint>& points,
                     const Gain& gain, double worth = -std::numeric_limits<double>::infinity());
/// The points that gain most by quick_gain(); all, of a few.
std::vector<GridPoint> nearest_of(const Evaluator& by, const Hypothesis& h, int joint, const UnitGrid& grid,
                                  const Channel& channel);
/// The same by what a joint does to its own torque, beside what its channel has.
UnitShape best_own_shape(const Evaluator& by, const Hypothesis& h, int joint, const UnitGrid& grid,
                         const Channel& channel, double kappa,
                         double worth = -std::numeric_limits<double>::infinity());
/// Shape parameter `s` of a unit between low and high, from where it is, by parabolas and, where these do not
/// lead on, by golden section (Brent 1973, chapter 5). Returns the gain; `best`: that of the unit as it is.
double improve(const Evaluator& by, const Hypothesis& h, UnitShape& unit, Eigen::Index s, double low,
               double high, bool logarithmic, double best, const Gain& gain);

}  // namespace dynid::detail
