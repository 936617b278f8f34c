// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// A random serial arm of 1 to 7 joints, the same for the same seed: revolute and prismatic joints, links of
/// 0.05 to 20 times the length of a usual arm's (masses go with its square), bodies that can exist, limits of
/// position, speed, acceleration and torque as drives of that size have them, and, in most, friction and
/// rotor inertia that the model knows. Its inertials satisfy eqs. (11) and (16).
Robot random_family_robot(unsigned long seed);

/// The kinds of motion in the family.
enum class FamilyMotion {
  exciting,        ///< Fourier series up to the limits
  pick_and_place,  ///< from point to point, with dwells: minimum jerk, or trapezoids of velocity
  slow,            ///< a Fourier series at a fraction of the speed
};

/// How the logs of one case are taken.
struct FamilyRun {
  FamilyMotion motion = FamilyMotion::exciting;
  double rate = 250.0;           ///< [Hz] of the log: 30 to 1000
  double control_rate = 1000.0;  ///< [Hz], a whole multiple of it
  double duration = 12.0;        ///< [s] of each log: 6 to 60
  int logs = 2;                  ///< 1 or 2
};
/// Draws them; the same for the same seed.
FamilyRun random_family_run(unsigned long seed);

/// A motion of that kind within the limits of the robot, sampled at `run.control_rate`, at rest at both ends.
/// The same for the same seed. Throws Error where random_motion() does.
Trajectory family_motion(const Robot& robot, const FamilyRun& run, unsigned long seed);

/// A point-to-point motion of `duration` [s] sampled at `rate` [Hz]: all joints together between random
/// points within 0.9 of their travel, at most at 0.9 of the limits of speed and acceleration, with dwells of
/// 0.2 to 1.5 times a move between. Unknown limits: as random_motion(). Throws Error on a duration or a rate
/// that is not positive.
Trajectory pick_and_place_motion(const Robot& robot, double duration, unsigned long seed, double rate);

/// draw_effect() for any robot: the ranges of the catalogue are those of an arm like the Panda, and what was
/// drawn is scaled, by the dimension of each parameter, with the robot's own torque ranges (torque_ranges()),
/// speeds, accelerations, travels (JointScale) and length to that arm's. Times, ratios and angles in deg
/// stay. Throws Error as draw_effect() and complete_effect() do (a value that leaves the catalogue's allowed
/// range), and on a pair of joints of different types.
Effect draw_family_effect(const std::string& name, const Robot& robot, unsigned long seed,
                          double strength = 1.0, double duration = 20.0);

/// The model that a vendor gives of the robot: without friction, rotor inertia and effects, its inertials off
/// by about `spread` (see perturbed()).
Robot as_a_vendor_says(const Robot& robot, double spread, unsigned long seed);

}  // namespace dynid
