// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "conversions.hpp"
#include "dynid/model/export.hpp"
#include "export_common.hpp"
#include "not_expressed.hpp"

namespace dynid {
namespace {

using namespace detail::exporting;

// [s] A servo's damping on a light joint is stiff, and MuJoCo's integrators are of first order.
constexpr double servo_timestep = 2e-4;

std::string mjcf_pose(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return attribute("pos", triple(pose.translation())) +
         attribute("quat", number(q.w()) + " " + number(q.x()) + " " + number(q.y()) + " " + number(q.z()));
}

std::string mjcf_inertial(const LinkInertia& body) {
  const PrincipalInertia principal = principal_inertia(body);
  return "<inertial" + mjcf_pose(principal.frame) + attribute("mass", number(body.mass)) +
         attribute("diaginertia", triple(principal.moments)) + "/>\n";
}

/// Springs at joint `k`, in parallel.
struct Spring {
  double stiffness = 0.0, moment = 0.0;  // [N m/rad], stiffness times rest position [N m]
};

Spring spring_of(const Robot& robot, std::size_t k) {
  LoopTerms terms(robot.size());
  for (const Effect& effect : robot.effects) {
    const EffectSchema* const schema = find_effect_schema(effect.name);
    if (schema != nullptr && detail::says(*schema, ExportFormat::mjcf))
      schema->compile(terms, checked_effect(effect, robot));
  }
  const auto j = static_cast<Eigen::Index>(k);
  return {terms.stiffness[j], -terms.offset[j]};
}

/// Has a servo in SI units, which an actuator can stand for.
bool is_servo(const Joint& joint) { return joint.servo && joint.servo->kp > 0.0; }

/// More than any joint of the robot moves [kg m^2] or, of the sliding ones, [kg].
double most_inertia(const Robot& robot) {
  double mass = 0.0, reach = 0.0, own = 0.0;
  for (const Joint& joint : robot.joints) {
    const LinkInertia body = from_standard(joint.parameters);
    mass += std::max(0.0, body.mass);
    reach += joint.origin.translation().norm() + body.com.norm();
    own += std::max(0.0, body.inertia.trace());
    if (joint.type == JointType::prismatic && bounded(joint.limits))
      reach += std::max(std::abs(joint.limits.lower), std::abs(joint.limits.upper));
  }
  return std::max({mass * reach * reach + own, mass, 1e-6});
}

/// A servo of which ratios to kp are known stands alone: so it does where drive and stiffness are so large
/// that what hangs on it does not matter.
Joint standing_alone(Joint joint, double inertia) {
  constexpr double heavier = 1e4;
  Servo& s = *joint.servo;
  joint.rotor_inertia = heavier * inertia;
  s.kp = joint.rotor_inertia * s.natural_frequency * s.natural_frequency;
  s.kd = 2.0 * s.damping_ratio * s.natural_frequency * joint.rotor_inertia;
  joint.friction = {};
  joint.friction.linear.coulomb = s.kp * s.coulomb_position;
  s.torque_limit = s.kp * s.error_limit;
  return joint;
}

/// kd of a servo whose torque is limited: dynid's limit is on the stiffness alone, MuJoCo's on all that an
/// actuator gives, so the damping goes to the joint.
double damping_of_joint(const Joint& joint) {
  return is_servo(joint) && std::isfinite(joint.servo->torque_limit) ? joint.servo->kd : 0.0;
}

std::string mjcf_joint(const Joint& joint, const Spring& spring, std::vector<std::string>& list) {
  const std::string prefix = "joint '" + joint.name + "': ";
  const JointLimits& limits = joint.limits;
  const LinearFriction& friction = joint.friction.linear;
  std::string text = "<joint" + attribute("name", joint.name) +
                     attribute("type", joint.type == JointType::prismatic ? "slide" : "hinge") +
                     attribute("axis", triple(joint.axis));
  if (limits.lower == limits.upper) {
    list.push_back(prefix + "position limits that are both " + number(limits.lower));
  } else if (bounded(limits)) {
    text += attribute("limited", "true") +
            attribute("range", position_limit(limits.lower) + " " + position_limit(limits.upper));
  }
  const double damping = friction.viscous + damping_of_joint(joint);
  if (damping != 0.0) text += attribute("damping", number(damping));
  if (friction.coulomb > 0.0) text += attribute("frictionloss", number(friction.coulomb));
  // MuJoCo's friction gives way by a part of the acceleration that it holds back; its usual part lets a servo
  // that sticks creep by mrad a second.
  if (friction.coulomb > 0.0 && is_servo(joint))
    text += attribute("solreffriction", number(2.0 * servo_timestep) + " 1") +
            attribute("solimpfriction", "0.9999 0.9999 0.001 0.5 2");
  if (joint.rotor_inertia > 0.0) text += attribute("armature", number(joint.rotor_inertia));
  if (spring.stiffness > 0.0)
    text += attribute("stiffness", number(spring.stiffness)) +
            attribute("springref", number(spring.moment / spring.stiffness + 0.0));
  else if (spring.stiffness < 0.0 || spring.moment != 0.0)
    list.push_back(prefix + "spring of stiffness " + number(spring.stiffness) + " " +
                   unit_of("N m/rad", joint.type));
  if (friction.coulomb < 0.0)
    list.push_back(prefix + "negative Coulomb friction " + number(friction.coulomb) + " N m");
  if (joint.rotor_inertia < 0.0)
    list.push_back(prefix + "negative rotor inertia " + number(joint.rotor_inertia) + " kg m^2");
  if (std::isfinite(limits.velocity)) list.push_back(prefix + "velocity limit " + number(limits.velocity));
  list_joint_not_expressed(joint, list);
  return text + "/>\n";
}

/// A position servo is written as what MuJoCo's shortcut <position> stands for: the shortcut of the version
/// that distributions ship knows no damping.
std::string mjcf_servo(const Joint& joint, std::vector<std::string>& list) {
  const Servo& s = *joint.servo;
  const std::string prefix = "joint '" + joint.name + "': servo: ";
  const double offset = s.kp * s.bias, kd = s.kd - damping_of_joint(joint);
  std::string text = "    <general" + attribute("name", joint.name) + attribute("joint", joint.name) +
                     attribute("biastype", "affine") + attribute("gainprm", number(s.kp)) +
                     attribute("biasprm", triple({-offset, -s.kp, -kd}));
  if (s.command_time_constant > 0.0)
    text += attribute("dyntype", "filter") + attribute("dynprm", number(s.command_time_constant));
  if (std::isfinite(s.torque_limit))
    text += attribute("forcelimited", "true") +
            attribute("forcerange", number(-s.torque_limit - offset) + " " + number(s.torque_limit - offset));
  if (s.delay != 0.0)
    list.push_back(prefix + "delay " + number(s.delay) +
                   " s: hold commands back by it before they are given");
  if (s.stribeck_position != 0.0)
    list.push_back(prefix + "Stribeck friction " + number(s.kp * s.stribeck_position) + " " +
                   unit_of("N m", joint.type) + " below " + number(s.stribeck_velocity) + " " +
                   unit_of("rad/s", joint.type));
  if (s.load_friction != 0.0)
    list.push_back(prefix + "friction of " + number(s.load_friction) + " of the load");
  return text + "/>\n";
}

std::string mjcf_motor(const Joint& joint) {
  const double limit = joint.limits.torque;
  std::string text = "    <motor" + attribute("name", joint.name) + attribute("joint", joint.name);
  if (std::isfinite(limit))
    text += attribute("ctrllimited", "true") + attribute("ctrlrange", number(-limit) + " " + number(limit));
  return text + "/>\n";
}

}  // namespace

ExportText to_mjcf(const Robot& given) {
  validate(given);
  Robot robot = with_effects_entered(given);
  check_names(robot);
  ExportText out;
  const double inertia = most_inertia(robot);
  for (Joint& joint : robot.joints) {
    if (!joint.servo || is_servo(joint) || !(joint.servo->natural_frequency > 0.0)) continue;
    joint = standing_alone(joint, inertia);
    out.not_expressed.push_back(
        "joint '" + joint.name +
        "': servo, of which ratios to kp are known only: it moves as they say, by a drive "
        "so strong and heavy that nothing moves it; its torques mean nothing");
  }
  std::string& text = out.text;
  // The zero bounds and the lone inertials keep MuJoCo from making anything of its own out of the numbers.
  text = "<mujoco" + attribute("model", robot.name) + ">\n" +
         "  <compiler angle=\"radian\" inertiafromgeom=\"false\" boundmass=\"0\" boundinertia=\"0\"/>\n" +
         "  <option" + attribute("gravity", triple(robot.gravity));
  if (std::any_of(robot.joints.begin(), robot.joints.end(), is_servo))
    text += attribute("timestep", number(servo_timestep)) + attribute("integrator", "implicit");
  text += "/>\n  <worldbody>\n";
  std::string indent = "    ", motors, filtered;  // MuJoCo wants actuators with a state behind those without
  std::size_t open = 0;
  const auto open_body = [&](const std::string& name, const std::string& pose) {
    text += indent + "<body" + attribute("name", name) + pose + ">\n";
    indent += "  ";
    ++open;
  };
  if (robot.base_link != "world") open_body(robot.base_link, "");
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const Joint& joint = robot.joints[k];
    const LinkInertia body = from_standard(joint.parameters);
    open_body(joint.link_name, mjcf_pose(joint.origin));
    text += indent + mjcf_inertial(body) + indent + mjcf_joint(joint, spring_of(robot, k), out.not_expressed);
    (is_servo(joint) && joint.servo->command_time_constant > 0.0 ? filtered : motors) +=
        is_servo(joint) ? mjcf_servo(joint, out.not_expressed) : mjcf_motor(joint);
    list_first_moments_not_expressed(joint.parameters, joint.link_name, out.not_expressed);
    constexpr double least = 1e-15;  // mjMINVAL
    list_impossible(body, joint.link_name, least, "MuJoCo", out.not_expressed);
  }
  const std::string tip = tip_name(robot);
  if (!tip.empty()) text += indent + "<site" + attribute("name", tip) + mjcf_pose(robot.tip) + "/>\n";
  for (; open > 0; --open) {
    indent.resize(indent.size() - 2);
    text += indent + "</body>\n";
  }
  text += "  </worldbody>\n  <actuator>\n" + motors + filtered + "  </actuator>\n</mujoco>\n";
  detail::list_effects_not_expressed(robot, ExportFormat::mjcf, out.not_expressed);
  return out;
}

}  // namespace dynid
