// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/for_simulation.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "effects/effects.hpp"

namespace dynid {
namespace {

/// Every key is one of the simulation's, with as many numbers as it takes.
bool understood(const Effect& effect, const EffectSpec& spec, std::size_t n) {
  for (const auto& [key, values] : effect.parameters) {
    const auto own = std::find_if(spec.parameters.begin(), spec.parameters.end(),
                                  [&key = key](const EffectParameter& p) { return p.key == key; });
    if (own == spec.parameters.end() || values.size() != (own->per_joint ? n : own->initial.size()))
      return false;
  }
  return true;
}

/// One effect a joint where what the simulation has once for all joints differs from joint to joint.
std::vector<Effect> by_joint(const Effect& effect, const std::string& key) {
  std::vector<Effect> out;
  for (const int joint : effect.joints) {
    Effect one = effect;
    one.joints = {joint};
    one.parameters[key] = {effect.parameters.at(key)[static_cast<std::size_t>(joint - 1)]};
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace

Robot for_simulation(const Robot& robot) {
  Robot out = robot;
  out.effects.clear();
  const auto n = static_cast<std::size_t>(robot.size());
  for (const Effect& given : robot.effects) {
    const EffectSpec& spec = simulation_effect(given.name);
    if (understood(given, spec, n)) {
      out.effects.push_back(given);
      continue;
    }
    const Hypothesis* const h = find_hypothesis(given);
    if (h == nullptr) throw Error("effect '" + given.name + "': cannot be simulated");
    for (const int unit : detail::units_of(*h, robot, given)) {  // names what is missing
      Eigen::VectorXd c, shape;
      h->restore(robot, given, unit, c, shape);
    }
    if (h->enter(out, given)) continue;
    Effect effect = given;
    if (effect.name == "presliding_hysteresis") {
      for (const int joint : effect.joints) {
        const auto j = static_cast<std::size_t>(joint - 1);
        const double coulomb = effect.parameters["coulomb"][j], slip = effect.parameters["slip"][j];
        if (!(coulomb > 0.0) || !(slip > 0.0))
          throw Error("effect 'presliding_hysteresis': coulomb and slip of joint " + std::to_string(joint) +
                      " must be positive to be simulated");
        auto& stiffness = effect.parameters["stiffness"];
        stiffness.resize(n, 0.0);
        stiffness[j] = coulomb / slip;
      }
      effect.parameters["damping"].assign(n, 0.0);
      effect.parameters.erase("slip");
    } else if (effect.name == "joint_elasticity") {
      effect.parameters.erase("damping");  // of the link there; here of the motor
    } else if (effect.name == "thermal_friction_drift") {
      // There the friction falls straight, in proportion to the integral of (dq / v)^2 / T: v such that it
      // has done the same in the end as the exponential fall here, T too long to cool down.
      constexpr double slow = 1e3;  // [s]
      for (const double constant : effect.parameters["motion_constant"])
        effect.parameters["reference_speed"].push_back(std::sqrt(2.0 * constant / slow));
      effect.parameters["time_constant"].assign(n, slow);
      effect.parameters.erase("motion_constant");
    } else if (effect.name == "backlash") {
      effect.parameters.erase("contact_torque");  // the smoothing of what is a plain dead zone there
      effect.parameters["gap"].assign(n, 0.0);
    }
    const auto width = effect.parameters.find("velocity_scale");
    if (width != effect.parameters.end() && width->second.size() == n && n > 1) {
      for (Effect& one : by_joint(effect, "velocity_scale")) out.effects.push_back(std::move(one));
    } else {
      out.effects.push_back(effect);
    }
    if (!understood(out.effects.back(), spec, n))
      throw Error("effect '" + given.name +
                  "': its parameters are neither the diagnosis' nor the simulation's");
  }
  return out;
}

}  // namespace dynid
