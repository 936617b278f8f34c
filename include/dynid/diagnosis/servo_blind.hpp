// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/diagnosis/blind.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// The robot with a position servo on every joint, drawn: natural frequency 12 to 28 rad/s (more where
/// gravity would else bend the joint by more than 3 % of its travel), damping ratio 0.5 to 1.2, a rotor of
/// 0.1 to 0.5 times the joint's inertia, Coulomb friction of 0.2 to 0.6 % of kp. Limits of speed and
/// acceleration become those of commands that such servos follow. Effects and friction that the robot has go.
/// The same for the same seed. Throws Error where joint_scales() does.
Robot with_random_servos(const Robot& robot, unsigned long seed);

/// run_blind() for servo logs: each case has servos of its own on the nominal robot (or, with
/// BlindOptions::family, on a random arm), two logs of random commands of 15 to 35 s at 50, 100 or 250 Hz by
/// simulate_servos(), and no effect, one or two, or a torque that no library has; diagnose_servos() sees
/// logs and nominal model alone. Kinds: clean; nominal: every parameter off by 2 %; weak: effects at 0.3
/// times their size; mixed: these in turn. BlindOptions::duration, rate and diagnose are not used but for
/// `diagnose.withhold`; BlindCase::true_shrink stays 0. Throws Error on the kind vendor, and where the folder
/// cannot be written.
std::vector<BlindCase> run_servo_blind(const Robot& nominal, const BlindOptions& options);

}  // namespace dynid
