// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/model/robot.hpp"

namespace dynid {

/// A patched robot as Plant understands it: effects in the words of the diagnosis become those of
/// simulation_effects(), or enter the robot's own parameters where these have a place for them; the others
/// stay. A joint's own width of the smoothed sign makes an effect a joint. Not the same law everywhere: slip
/// elements become LuGre friction of the same stiffness, a spring in a joint gets a motor of the usual
/// inertia. Allocates. Throws Error in one line, naming the effect, where there is no such form.
Robot for_simulation(const Robot& robot);

}  // namespace dynid
