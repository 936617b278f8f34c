// SPDX-License-Identifier: Apache-2.0
// Effects that are another rigid body: payload, link_inertial_error, gravity_tilt, rotor_inertia.
#include <cmath>

#include "dynid/base/error.hpp"
#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class Payload : public EffectModel {
 public:
  Payload(const Effect& effect, const Robot& robot) : body_(payload_body(robot, effect)) {}
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override { robot.joints.back().parameters += body_; }

 private:
  StandardParameters body_;
};

class LinkInertialError : public EffectModel {
 public:
  LinkInertialError(const Effect& effect, const Robot& robot)
      : effect_(effect), link_(static_cast<std::size_t>(effect.joints.front() - 1)) {
    if (!(robot.joints[link_].parameters[0] + value(effect, "mass") > 0.0))
      throw Error("effect 'link_inertial_error': mass: link " + std::to_string(effect.joints.front()) +
                  " would be left without mass");
  }
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override {
    StandardParameters& link = robot.joints[link_].parameters;
    link += link_change(link, effect_);
  }

 private:
  Effect effect_;
  std::size_t link_;
};

void draw_link(Effect& effect, const Robot& robot, std::mt19937_64& random, double strength, double) {
  // Half as much again of a heavy link can be felt, of a hand not: that gets a part of the arm.
  double arm = 0.0;
  for (const Joint& joint : robot.joints) arm += joint.parameters[0];
  const LinkInertia link =
      from_standard(robot.joints[static_cast<std::size_t>(effect.joints.front() - 1)].parameters);
  const double sign = random() % 2 == 0 ? 1.0 : -1.0;
  double change = strength * std::max(0.05 * arm, 0.5 * link.mass) * uniform(random, 0.5, 1.0) * sign;
  if (link.mass + change < 0.3 * link.mass) change = -change;
  effect.parameters["mass"] = {change};
}

class GravityTilt : public EffectModel {
 public:
  GravityTilt(const Effect& effect, const Robot&) : effect_(effect) {}
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override {
    robot.gravity = gravity_turn(robot.gravity, effect_) * robot.gravity;
  }

 private:
  Effect effect_;
};

class RotorInertia : public EffectModel {
 public:
  RotorInertia(const Effect& effect, const Robot&) : armature_(values(effect, "armature")) {}
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override {
    for (int j = 0; j < robot.size(); ++j)
      robot.joints[static_cast<std::size_t>(j)].rotor_inertia += armature_[j];
  }

 private:
  Eigen::VectorXd armature_;
};

}  // namespace

std::vector<EffectDefinition> rigid_body_effects() {
  return {
      {"payload",
       {{"mass", {0.7}, {3.0}, false, Scale::times},
        {"com", {-0.05, -0.05, 0.03}, {0.05, 0.05, 0.2}, false, Scale::none},
        {"radius", {0.02}, {0.06}, false, Scale::none}},
       &make_model<Payload>},
      {"link_inertial_error",
       {{"mass", {0.5}, {1.5}, false, Scale::none},
        {"com", {-0.03, -0.03, -0.03}, {0.03, 0.03, 0.03}, false, Scale::times},
        {"inertia", {-0.2}, {0.5}, false, Scale::times}},
       &make_model<LinkInertialError>,
       &draw_link},
      {"gravity_tilt",
       {{"angle_deg", {1.5}, {4.0}, true, Scale::times},
        {"direction_deg", {-180.0}, {180.0}, false, Scale::none}},
       &make_model<GravityTilt>},
      {"rotor_inertia", {{"armature", {0.15}, {0.5}, false, Scale::times}}, &make_model<RotorInertia>},
  };
}

}  // namespace dynid::detail
