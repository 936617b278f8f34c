// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/effect/complete.hpp"
#include "dynid/effect/derived.hpp"
#include "dynid/signal/filter.hpp"
#include "effects/effects.hpp"

namespace dynid {
namespace {

constexpr double span_both_ways = 100.0;  // of the largest to where the grid turns to 0

}  // namespace

double ShapeParameter::at(double part) const {
  if (both_ways()) {
    const double x = 2.0 * part - 1.0;
    return std::abs(x) < 1e-9 ? 0.0 : std::copysign(high * std::pow(span_both_ways, std::abs(x) - 1.0), x);
  }
  return logarithmic ? low * std::pow(high / low, part) : low + part * (high - low);
}

std::pair<double, double> ShapeParameter::beside(double x) const {
  const double step = 1.0 / (points - 1);
  if (both_ways()) {
    const double ratio = std::pow(span_both_ways, 2.0 * step), least = at(0.5 + step), size = std::abs(x);
    if (size < 0.5 * least) return {-least, least};
    const double near = size < 1.001 * least ? 0.0 : size / ratio, far = std::min(high, size * ratio);
    return x > 0.0 ? std::pair{near, far} : std::pair{-far, -near};
  }
  if (!logarithmic) {
    const double width = step * (high - low);
    return {std::max(low, x - width), std::min(high, x + width)};
  }
  const double ratio = std::pow(high / low, step);
  return {std::max(low, x / ratio), std::min(high, x * ratio)};
}

double ShapeParameter::size_at(double x) const {
  if (both_ways()) return std::max(std::abs(x), high / span_both_ways);
  return logarithmic ? std::abs(x) : high - low;
}

std::pair<int, int> pair_of(int n, int unit) {
  const bool neighbours = unit < n - 1;
  const int first = neighbours ? unit : unit - (n - 1);
  return {first, first + (neighbours ? 1 : 2)};
}

JointScale arm_scale(const std::vector<JointScale>& joints, double reach) {
  std::vector<double> durations, torques;
  for (const JointScale& s : joints) {
    durations.push_back(s.duration());
    torques.push_back(s.torque);
  }
  JointScale arm;
  arm.type = JointType::prismatic;
  arm.travel = reach;
  arm.speed = reach / median(durations);
  arm.torque = median(torques) / reach;
  arm.sampling = joints.front().sampling;
  arm.recorded = joints.front().recorded;
  return arm;
}

std::vector<ShapeParameter> Hypothesis::shape_of(int unit, const std::vector<JointScale>& joints,
                                                 double reach) const {
  if (scope() == Scope::arm || scope() == Scope::window) return shape_on(arm_scale(joints, reach));
  const int joint = scope() == Scope::pair ? pair_of(static_cast<int>(joints.size()), unit).first : unit;
  return shape_on(joints[static_cast<std::size_t>(joint)]);
}

int Hypothesis::units(const Robot& robot) const {
  const int n = robot.size();
  if (scope() == Scope::arm) return 1;
  return scope() == Scope::pair ? std::max(0, n - 1) + std::max(0, n - 2) : n;
}

std::vector<int> Hypothesis::joints(const Robot& robot, int unit) const {
  switch (scope()) {
    case Scope::joint:
      return {unit + 1};
    case Scope::pair: {
      const auto [first, second] = pair_of(robot.size(), unit);
      return {first + 1, second + 1};
    }
    case Scope::link:
      return {unit + 1};
    case Scope::window: {
      std::vector<int> all(static_cast<std::size_t>(unit) + 1);
      std::iota(all.begin(), all.end(), 1);
      return all;
    }
    case Scope::arm:
      break;
  }
  std::vector<int> all(robot.joints.size());
  std::iota(all.begin(), all.end(), 1);
  return all;
}

const Hypothesis* find_hypothesis(const std::string& name) {
  for (const auto& h : hypotheses())
    if (h->name() == name) return h.get();
  return nullptr;
}

const Hypothesis* find_hypothesis(const Effect& effect) {
  const EffectSchema* const schema = find_effect_schema(effect.name);
  if (schema == nullptr || schema->forms.empty() || effect.joints.empty())
    return find_hypothesis(effect.name);
  std::string form = effect_form(effect, effect.joints.front() - 1);
  // A joint that warms by moving and cools again is nearest to one that does not cool.
  if (effect.name == "thermal_friction_drift" && motion_constant(effect, effect.joints.front() - 1) > 0.0)
    form = "motion_constant";
  const Hypothesis* plain = nullptr;
  for (const auto& h : hypotheses()) {
    if (h->name() != effect.name) continue;
    if (h->form() == form) return h.get();
    if (h->form().empty()) plain = h.get();
  }
  return plain != nullptr ? plain : find_hypothesis(effect.name);
}

Eigen::MatrixXd effect_torque(const Robot& robot, const GapMotion& motion) {
  Eigen::MatrixXd tau = Eigen::MatrixXd::Zero(motion.samples(), robot.size()), delayed = tau;
  Eigen::VectorXd lateness = Eigen::VectorXd::Zero(robot.size());
  std::vector<Effect> effects;
  for (const Effect& effect : robot.effects)
    for (Effect& part : split_forms(checked_effect(effect, robot), robot)) effects.push_back(std::move(part));
  for (const Effect& effect : effects) {
    const Hypothesis* h = find_hypothesis(effect);
    if (h == nullptr) throw Error("effect '" + effect.name + "': the diagnosis has no law for it");
    for (const int unit : detail::units_of(*h, robot, effect)) {
      Eigen::VectorXd c, shape;
      h->restore(robot, effect, unit, c, shape);
      const ColumnBlock block = h->columns(motion, unit, shape);
      const double late = h->lateness(shape);
      for (std::size_t k = 0; k < block.channels.size(); ++k) {
        const int j = block.channels[k];
        lateness[j] += late;
        (late != 0.0 ? delayed : tau).col(j) += block.values[k] * c;
      }
    }
  }
  for (int j = 0; j < robot.size(); ++j)
    if (lateness[j] != 0.0)
      tau.col(j) = interpolate(motion.t, Eigen::VectorXd(tau.col(j)), motion.t.array() - lateness[j]);
  return tau + delayed;
}

}  // namespace dynid
