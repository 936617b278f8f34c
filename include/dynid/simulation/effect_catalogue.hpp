// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// One parameter of an effect that the plant can have.
struct EffectParameter {
  /// How EffectStrength scales what draw_effect() drew.
  enum class Scale { none, times, divided };

  std::string key;
  std::string unit;               ///< SI, `1` where there is none
  std::string text;               ///< one line for a person
  bool per_joint;                 ///< one number for each joint of the robot; else `initial.size()` numbers
  std::vector<double> initial;    ///< default; one number where per_joint
  double least, most;             ///< values allowed, both included
  std::vector<double> low, high;  ///< range to draw from, as many as `initial`, for an arm like the Panda
  bool either_sign = false;       ///< what was drawn gets a random sign
  Scale scale = Scale::none;
};

/// Which joints draw_effect() gives an effect, and what `joints` means.
enum class EffectScope {
  joints,     ///< any number of joints, each with parameters of its own
  one_link,   ///< one joint: the link that it carries
  pair,       ///< two joints
  whole_arm,  ///< all joints
};

/// An effect that the plant can have.
struct EffectSpec {
  std::string name;  ///< of the catalogue
  std::string text;  ///< torque added on the measured side, in a line
  EffectScope scope = EffectScope::joints;
  std::vector<EffectParameter> parameters;
};

/// The catalogue: every effect that Plant understands, with its parameters.
///
/// The sign throughout: measured torque = torque of the nominal model along the measured motion + the
/// effect's torque, so that friction coefficients are positive.
const std::vector<EffectSpec>& simulation_effects();

/// The entry of that name. Throws Error `effect 'x': unknown; known: ...`.
const EffectSpec& simulation_effect(const std::string& name);

/// The effect with every parameter in place (defaults where left out; per-joint ones zero off its joints),
/// its joints filled in where the whole arm is meant. Throws Error naming the effect, the key and what is
/// wrong: unknown name or key, wrong number of values, a value out of range or not finite, a joint that the
/// robot does not have or that is named twice.
Effect complete_effect(const Effect& effect, const Robot& robot);

/// An effect from `NAME[:key=value,...]`, completed. Joints are `joints=1+3+5` (left out: all); a value of
/// several numbers is `com=0.01:0.02:0.1`; a parameter over joints takes one number for all of `joints` or
/// one for each of them. Throws Error as complete_effect() does.
Effect parse_effect(const std::string& text, const Robot& robot);

/// A random effect of that name: joints and parameters within the ranges of the catalogue, completed.
/// `strength` scales the torque that it makes (1: as the catalogue's ranges; 0.3: weak); `duration` [s] is
/// that of the motion, for what happens in a window. The same for the same seed. Throws Error on an unknown
/// name and on a robot with too few joints.
Effect draw_effect(const std::string& name, const Robot& robot, unsigned long seed, double strength = 1.0,
                   double duration = 20.0);

}  // namespace dynid
