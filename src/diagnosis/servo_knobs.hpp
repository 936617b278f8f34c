// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "dynid/dynamics/servo_joint.hpp"
#include "dynid/model/robot.hpp"
#include "servo_load_parts.hpp"

namespace dynid::detail {

/// What can be turned at a servo joint. Torques are in N m where kp is known; elsewhere kp stands for 1, and
/// they are position errors.
enum class Knob {
  kp,
  inertia,
  damping,  ///< of servo and joint together
  coulomb,
  bias,
  delay,
  stribeck,
  stribeck_velocity,
  load_friction,
  load_gain,  ///< of the rigid body's torque; 0 where kp is not known
  limit,
  lag,
  spring,
  backlash,
  gravity_compensation,
  load_part  ///< the first of servo_load_parts: of ServoSeries::parts, in standard deviations
};
constexpr int servo_knobs = 15 + servo_load_parts;
constexpr std::size_t at(Knob k) { return static_cast<std::size_t>(k); }

using Knobs = std::array<double, servo_knobs>;
using KnobSlopes = Eigen::Array<double, servo_knobs, 1>;
/// A joint's state with derivatives by all that its knobs turn.
using KnobState = ServoState<true, servo_load_parts>;
constexpr Knob load_part(int k) { return static_cast<Knob>(static_cast<int>(Knob::load_part) + k); }
constexpr bool is_load_part(Knob k) { return k >= Knob::load_part; }

Knobs knobs_of(const Robot& robot, int joint);
ServoJoint servo_of(const Knobs& x);
/// d/d knob from d/d ratio.
KnobSlopes knob_slopes(const Knobs& x, const KnobState::Sensitivity& s);
/// Writes the knobs that differ from `nominal` into joint `joint` (from 0); gravity_compensation is of the
/// whole arm and left out.
void turn(Robot& robot, int joint, const Knobs& nominal, const Knobs& x);

/// Where a fit may go, and how.
struct KnobRange {
  bool logarithmic = false;
  double low = 0.0, high = 0.0;
};

/// Sizes of a joint's own, over its logs.
struct KnobScale {
  double interval = 0.0;  ///< [s] between commands
  double speed = 0.0;     ///< rms of the command's, while it moves
  double error = 0.0;     ///< largest |u - q|
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;  ///< position
  double gravity = 0.0;  ///< largest of the rigid body's [N m]
  double load = 0.0;     ///< rms of the rigid body's torque [N m]
  bool moves = false;
};
KnobRange range_of(Knob k, const Knobs& nominal, const KnobScale& scale);

/// A number of an effect, as it is reported.
struct KnobWord {
  Knob knob;
  const char *key, *unit;
  bool added;  ///< the change; else the whole value
};

/// An effect of one joint: what it frees, and where its search starts.
struct ServoEffect {
  const char* name;
  std::vector<Knob> free;
  std::vector<const char*> aliases;  ///< that no motion tells from it
};
const std::vector<ServoEffect>& servo_effects();
inline const ServoEffect& effect_of(int e) { return servo_effects()[static_cast<std::size_t>(e)]; }
/// Starting points with the effect in it.
std::vector<Knobs> starts_of(const ServoEffect& effect, const Knobs& from, const KnobScale& scale);
/// The effect makes sense for such a joint.
bool applies(const ServoEffect& effect, const Knobs& nominal, const KnobScale& scale);
/// Such a joint can exist: a spring rests within a travel's length of where the joint goes (else it is an
/// offset).
bool possible(const ServoEffect& effect, const Knobs& x, const Knobs& nominal, const KnobScale& scale);
/// What is reported of it, `si`: kp is known.
std::vector<KnobWord> words_of(const ServoEffect& effect, bool si);

}  // namespace dynid::detail
