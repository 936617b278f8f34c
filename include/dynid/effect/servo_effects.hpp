// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/effect/schema.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// The effects that only a position servo has, by the words of the diagnosis of servo logs: servo_stiffness,
/// servo_damping, command_delay, command_filter, gravity_compensation. They change how a joint answers a
/// commanded position; a torque log shows none of them, and they are no part of effect_schemas().
const std::vector<EffectSchema>& servo_effect_schemas();

/// parse_effect() with the words of both catalogues, for a robot whose joints have servos. A stiffness may be
/// given as `kp` [N m/rad] or as `factor` of the model's, and comes out as kp where the model has one. Throws
/// Error as parse_effect() does; naming the joint that has no servo.
Effect parse_servo_effect(const std::string& text, const Robot& robot);

/// Puts into the servos of `robot` what has its place there: servo_stiffness, servo_damping, command_delay,
/// command_filter; encoder_offset (as the servo's bias: logged and commanded position have another zero) and
/// torque_saturation (as its limit). False for every other effect, which leaves the robot as it was. Throws
/// Error naming the joint that has no servo.
bool enter_servo(Robot& robot, const Effect& effect);

}  // namespace dynid
