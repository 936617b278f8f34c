// SPDX-License-Identifier: Apache-2.0
#include "effects.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/friction/friction.hpp"
#include "named.hpp"

namespace dynid::detail {

namespace {

const std::vector<double>& values_of(const Effect& effect, const std::string& key, std::size_t size) {
  const auto found = effect.parameters.find(key);
  if (found == effect.parameters.end())
    throw Error("effect '" + effect.name + "': parameter '" + key + "' is missing");
  if (found->second.size() != size)
    throw Error("effect '" + effect.name + "': parameter '" + key + "' has " +
                std::to_string(found->second.size()) + " values, " + std::to_string(size) + " are needed");
  return found->second;
}

}  // namespace

double joint_value(const Robot& robot, const Effect& effect, const std::string& key, int unit) {
  return values_of(effect, key, robot.joints.size())[static_cast<std::size_t>(unit)];
}

Eigen::VectorXd arm_value(const Effect& effect, const std::string& key, int size) {
  return Eigen::Map<const Eigen::VectorXd>(values_of(effect, key, static_cast<std::size_t>(size)).data(),
                                           size);
}

std::vector<int> units_of(const Hypothesis& h, const Robot& robot, const Effect& effect) {
  if (h.scope() == Scope::arm) return {0};
  if (effect.joints.empty()) throw Error("effect '" + effect.name + "': joints are missing");
  if (h.scope() == Scope::pair) {
    for (int unit = 0; unit < h.units(robot); ++unit)
      if (h.joints(robot, unit) == effect.joints) return {unit};
    throw Error("effect '" + effect.name + "': two joints are needed, with at most one between them");
  }
  if (h.scope() == Scope::window) return {effect.joints.back() - 1};
  std::vector<int> units;
  for (const int joint : effect.joints) {
    if (joint < 1 || joint > robot.size())
      throw Error("effect '" + effect.name + "': there is no joint " + std::to_string(joint));
    units.push_back(joint - 1);
  }
  return units;
}

ColumnBlock all_channels(const std::vector<Eigen::MatrixXd>& columns) {
  ColumnBlock block;
  const auto size = static_cast<Eigen::Index>(columns.size());
  for (Eigen::Index j = 0; j < columns.front().cols(); ++j) {
    block.channels.push_back(static_cast<int>(j));
    Eigen::MatrixXd values(columns.front().rows(), size);
    for (Eigen::Index k = 0; k < size; ++k) values.col(k) = columns[static_cast<std::size_t>(k)].col(j);
    block.values.push_back(std::move(values));
  }
  return block;
}

std::vector<NamedValue> OwnTorque::parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                              const Eigen::VectorXd& shape) const {
  const bool known = find_effect_schema(name_) != nullptr;  // else an effect of one's own
  std::vector<NamedValue> values;
  for (std::size_t k = 0; k < coefficients_.size(); ++k)
    values.push_back(known ? named(name_, coefficients_[k].key, robot, unit, c[static_cast<Eigen::Index>(k)])
                           : NamedValue{coefficients_[k].key, coefficients_[k].unit,
                                        Eigen::VectorXd::Constant(1, c[static_cast<Eigen::Index>(k)])});
  const std::vector<ShapeParameter> shapes = this->shape();
  for (std::size_t k = 0; k < shapes.size(); ++k)
    values.push_back(known ? named(name_, shapes[k].key, robot, unit, shape[static_cast<Eigen::Index>(k)])
                           : NamedValue{shapes[k].key, shapes[k].unit,
                                        Eigen::VectorXd::Constant(1, shape[static_cast<Eigen::Index>(k)])});
  return values;
}

void OwnTorque::restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
                        Eigen::VectorXd& shape) const {
  c = Eigen::VectorXd::Ones(shape_only() ? 1 : static_cast<Eigen::Index>(coefficients_.size()));
  for (Eigen::Index k = 0; k < c.size() && !shape_only(); ++k)
    c[k] = joint_value(robot, effect, coefficients_[static_cast<std::size_t>(k)].key, unit);
  const std::vector<ShapeParameter> shapes = this->shape();
  shape.resize(static_cast<Eigen::Index>(shapes.size()));
  for (Eigen::Index k = 0; k < shape.size(); ++k)
    shape[k] = joint_value(robot, effect, shapes[static_cast<std::size_t>(k)].key, unit);
}

ShapeParameter sign_width() { return {"velocity_scale", "rad/s", 0.002, 0.2, 3, true}; }

ShapeParameter sign_width(const JointScale& scale) {
  return {"velocity_scale", "rad/s", 1e-3 * scale.speed, 0.1 * scale.speed, 3, true};
}

Eigen::VectorXd smooth_signs(const GapMotion& motion, int joint, double scale) {
  return (motion.speed.col(joint).array() / scale).tanh();
}

double usual_speed(const Robot& robot, int joint) {
  const Joint& of = robot.joints[static_cast<std::size_t>(joint)];
  if (std::isfinite(of.limits.velocity) && of.limits.velocity > 0.0) return 0.5 * of.limits.velocity;
  const double reach = arm_reach(robot), gravity = robot.gravity.norm();
  const bool slides = of.type == JointType::prismatic;
  if (!(gravity > 0.0)) return slides ? reach : 1.0;  // nothing swings: one reach, or one radian, a second
  return std::sqrt(slides ? gravity * reach : gravity / reach);
}

double nominal_friction(const Robot& robot, int joint, double speed) {
  const JointFriction& f = robot.joints[static_cast<std::size_t>(joint)].friction;
  return 0.5 * (friction_torque(f, speed) - friction_torque(f, -speed));
}

namespace {

bool has_effect(const Robot& robot, const char* name) {
  return std::any_of(robot.effects.begin(), robot.effects.end(),
                     [&](const Effect& e) { return e.name == name; });
}

}  // namespace

bool without_friction(const Robot& nominal) {
  for (const Effect& e : nominal.effects)
    if (const EffectSchema* schema = find_effect_schema(e.name); schema != nullptr && schema->friction)
      return false;
  for (int j = 0; j < nominal.size(); ++j)
    if (nominal_friction(nominal, j, usual_speed(nominal, j)) != 0.0) return false;
  return true;
}

bool without_rotors(const Robot& nominal) {
  return !has_effect(nominal, "rotor_inertia") &&
         std::all_of(nominal.joints.begin(), nominal.joints.end(),
                     [](const Joint& joint) { return joint.rotor_inertia == 0.0; });
}

bool hinders(const Robot& robot, int joint, double speed, double torque) {
  constexpr double room = 0.05;
  return torque + nominal_friction(robot, joint, speed) > -room * std::abs(torque);
}

}  // namespace dynid::detail
