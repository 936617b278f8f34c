// SPDX-License-Identifier: Apache-2.0
// Effects that are another rigid body: payload, link_inertial_error, gravity_tilt, rotor_inertia.
#include <cmath>

#include "dynid/base/error.hpp"
#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class Payload : public EffectModel {
 public:
  Payload(const Effect& effect, const Robot&) {
    body_.mass = value(effect, "mass");
    body_.com = values(effect, "com");
    const double radius = value(effect, "radius");
    body_.inertia = 0.4 * body_.mass * radius * radius * Eigen::Matrix3d::Identity();  // a solid ball
  }
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override {
    robot.joints.back().parameters += transformed(to_standard(body_), robot.tip);
  }

 private:
  LinkInertia body_;
};

class LinkInertialError : public EffectModel {
 public:
  LinkInertialError(const Effect& effect, const Robot& robot)
      : link_(static_cast<std::size_t>(effect.joints.front() - 1)),
        mass_(value(effect, "mass")),
        inertia_(value(effect, "inertia")),
        com_(values(effect, "com")) {
    if (!(from_standard(robot.joints[link_].parameters).mass + mass_ > 0.0))
      throw Error("effect 'link_inertial_error': mass: link " + std::to_string(effect.joints.front()) +
                  " would be left without mass");
  }
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override {
    LinkInertia link = from_standard(robot.joints[link_].parameters);
    link.mass += mass_;
    link.com += com_;
    link.inertia *= 1.0 + inertia_;
    robot.joints[link_].parameters = to_standard(link);
  }

 private:
  std::size_t link_;
  double mass_, inertia_;
  Eigen::Vector3d com_;
};

void draw_link(Effect& effect, const Robot& robot, std::mt19937_64& random, double strength, double) {
  // Half as much again of a heavy link can be felt, of a hand not.
  const LinkInertia link =
      from_standard(robot.joints[static_cast<std::size_t>(effect.joints.front() - 1)].parameters);
  const double sign = random() % 2 == 0 ? 1.0 : -1.0;
  double change = strength * std::max(0.8, 0.5 * link.mass) * uniform(random, 0.5, 1.0) * sign;
  if (link.mass + change < 0.3 * link.mass) change = -change;
  effect.parameters["mass"] = {change};
}

class GravityTilt : public EffectModel {
 public:
  GravityTilt(const Effect& effect, const Robot&) {
    const double azimuth = value(effect, "direction_deg") * M_PI / 180.0;
    turn_ = Eigen::AngleAxisd(value(effect, "angle_deg") * M_PI / 180.0,
                              Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0));
  }
  bool changes_body() const override { return true; }
  void change(Robot& robot) const override { robot.gravity = turn_ * robot.gravity; }

 private:
  Eigen::AngleAxisd turn_;
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
  return {{{"payload",
            "a solid ball fixed to the tip: Y_tip(q, dq, ddq) pi",
            EffectScope::whole_arm,
            {{"mass", "kg", "", false, {1.0}, 0.0, 100.0, {0.7}, {3.0}, false, Scale::times},
             {"com",
              "m",
              "centre of the ball in the frame of the tip",
              false,
              {0.0, 0.0, 0.1},
              -2.0,
              2.0,
              {-0.05, -0.05, 0.03},
              {0.05, 0.05, 0.2}},
             {"radius", "m", "of the ball", false, {0.04}, 0.0, 1.0, {0.02}, {0.06}}}},
           &make_model<Payload>},
          {{"link_inertial_error",
            "one link is another body than the model says",
            EffectScope::one_link,
            {{"mass", "kg", "change of the mass", false, {0.5}, -100.0, 100.0, {0.5}, {1.5}},
             {"com",
              "m",
              "change of the centre of mass, in the link frame",
              false,
              {0.0, 0.0, 0.0},
              -2.0,
              2.0,
              {-0.03, -0.03, -0.03},
              {0.03, 0.03, 0.03},
              false,
              Scale::times},
             {"inertia",
              "1",
              "relative change of the inertia about it",
              false,
              {0.0},
              -0.9,
              10.0,
              {-0.2},
              {0.5},
              false,
              Scale::times}}},
           &make_model<LinkInertialError>,
           &draw_link},
          {{"gravity_tilt",
            "the base is not level: gravity is turned about a horizontal axis",
            EffectScope::whole_arm,
            {{"angle_deg", "deg", "", false, {2.0}, -180.0, 180.0, {1.5}, {4.0}, true, Scale::times},
             {"direction_deg",
              "deg",
              "azimuth of the axis in the x-y plane of the base frame",
              false,
              {0.0},
              -360.0,
              360.0,
              {-180.0},
              {180.0}}}},
           &make_model<GravityTilt>},
          {{"rotor_inertia",
            "Ia ddq",
            EffectScope::joints,
            {{"armature",
              "kg m^2",
              "Ia, reflected to the joint",
              true,
              {0.2},
              0.0,
              100.0,
              {0.15},
              {0.5},
              false,
              Scale::times}}},
           &make_model<RotorInertia>}};
}

}  // namespace dynid::detail
