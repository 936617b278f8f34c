// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "dynid/diagnosis/effect_prediction.hpp"
#include "dynid/effect/complete.hpp"
#include "dynid/effect/parse.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid::test {

/// A chain of bodies of 4 kg without friction, with room to move.
inline Robot chain(const std::vector<JointType>& types) {
  Robot robot;
  robot.name = "chain";
  for (std::size_t k = 0; k < types.size(); ++k) {
    Joint joint = make_joint("j" + std::to_string(k + 1), types[k],
                             {k == 0 ? 0.0 : 0.3, k % 2 == 0 ? 1.2 : -0.9, 0.1, 0.2});
    joint.parameters = to_standard({4.0, {0.15, -0.05, 0.1}, Eigen::Vector3d(0.06, 0.07, 0.05).asDiagonal()});
    const bool linear = types[k] == JointType::prismatic;
    joint.limits.lower = linear ? -0.3 : -2.0;
    joint.limits.upper = linear ? 0.3 : 2.0;
    joint.limits.velocity = linear ? 0.5 : 2.0;
    joint.limits.torque = 200.0;
    robot.joints.push_back(joint);
  }
  robot.tip.translation() = Eigen::Vector3d(0.0, 0.05, 0.1);
  return robot;
}

inline Robot robot_of(const std::string& name) {
  if (name == "one_joint") return chain({JointType::revolute});
  if (name == "prismatic") return chain({JointType::revolute, JointType::prismatic, JointType::revolute});
  Robot robot = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  for (Joint& joint : robot.joints) joint.friction = {};  // the plant smooths it, the model does not
  return robot;
}

/// The effect by its defaults, and by each other form that it has.
inline std::vector<Effect> cases_of(const EffectSchema& schema, const Robot& robot) {
  if (schema.name == "external_contact")
    return {parse_effect("external_contact:start=0.2,duration=0.6,point=0.1:0.05:0.1", robot)};
  if (schema.name == "torque_saturation")
    return {parse_effect("torque_saturation:limit=2", robot),
            parse_effect("torque_saturation:command_limit=500", robot)};
  std::vector<Effect> all = {parse_effect(schema.name, robot)};
  const auto add = [&](const char* name, const char* text) {
    if (schema.name == name) all.push_back(parse_effect(std::string(name) + ":" + text, robot));
  };
  add("payload", "mass=1.2,com=0.02:0.01:0.1,inertia=0.01:0:0:0.012:0:0.009");
  add("link_inertial_error",
      "mass=0.4,first_moment=0.02:0.01:0.03,inertia_about_origin=0.01:0:0.01:0:0:0.01");
  add("presliding_hysteresis", "coulomb=1.5,slip=0.03");
  add("thermal_friction_drift", "coefficient=2,motion_constant=1.5");
  add("thermal_friction_drift", "coefficient=2,time_constant=3,reference_speed=0");
  add("time_delay", "channel_delay_s=0.007");
  add("joint_elasticity", "stiffness=6000,damping=0.1");
  add("backlash", "dead_zone=0.6");
  return all;
}

inline SimulatedRun run(const Robot& robot, const std::vector<Effect>& effects) {
  SimulateOptions options;
  return simulate(robot, effects, random_motion(robot, 1.0, 3), options);
}

/// A log of what perfect electronics see, with its accelerations.
inline Log seen(const SimulatedRun& run) {
  Log log;
  log.source = "simulated";
  log.t = run.t, log.q = run.seen_q, log.dq = run.seen_dq, log.ddq = run.seen_ddq, log.tau = run.seen_tau;
  return log;
}

/// What `dynid torque` says.
inline Eigen::MatrixXd predicted(const Robot& robot, const Log& log) {
  return predict_torque(robot, log).tau + predict_effects(robot, log);
}

/// What the fitted law follows only in part along so short a motion: play in a joint and a spring that
/// swings, whose blows nobody can follow, a command that only the torque shows, and a bristle that gives way
/// by and by where the fitted one slips at once, in a motion not much larger than its slip.
inline bool harder(const Effect& effect) {
  for (const char* name : {"backlash", "joint_elasticity", "torque_saturation", "presliding_hysteresis"})
    if (effect.name == name) return true;
  return false;
}

inline Robot with(const Robot& robot, const Effect& effect) {
  Robot out = robot;
  out.effects = {effect};
  return out;
}

inline bool any_of(const Effect& effect, const char* key) {
  const auto found = effect.parameters.find(key);
  return found != effect.parameters.end() && detail::any_of_value(found->second);
}

inline std::string error_of(const std::function<void()>& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

struct Case {
  std::string effect, robot;
};
inline std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.effect << " on " << c.robot;
}
inline std::vector<Case> all_cases() {
  std::vector<Case> all;
  for (const EffectSchema& schema : effect_schemas())
    for (const char* robot : {"panda", "one_joint", "prismatic"})
      if (schema.scope != EffectScope::pair || std::string(robot) != "one_joint")
        all.push_back({schema.name, robot});
  return all;
}

/// One effect of the catalogue on one robot.
class EffectOnRobot : public ::testing::TestWithParam<Case> {
 protected:
  const Robot robot_ = robot_of(GetParam().robot);
  const EffectSchema& schema_ = effect_schema(GetParam().effect);
  const std::vector<Effect> cases_ = cases_of(schema_, robot_);
};

inline std::string case_name(const ::testing::TestParamInfo<Case>& entry) {
  return entry.param.effect + "_" + entry.param.robot;
}

}  // namespace dynid::test
