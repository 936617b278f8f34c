// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/model/robot.hpp"

namespace dynid {

/// A robot whose parameters differ from the given one's at random by about `spread` (relative, 0.02: 2 %),
/// the same for the same seed. The pseudo-inertia of a link, P = L L^T, becomes L (1 + E)(1 + E)^T L^T with E
/// small and random: a body that can exist stays one. Friction and rotor inertia are scaled each by 1 +
/// spread times a normal number. Throws Error unless 0 <= spread < 0.5.
Robot perturbed(const Robot& robot, double spread, unsigned long seed);

}  // namespace dynid
