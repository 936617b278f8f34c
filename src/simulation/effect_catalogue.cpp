// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/effect_catalogue.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "effects/effect_model.hpp"

namespace dynid {
namespace detail {

const std::vector<EffectDefinition>& effect_definitions() {
  static const std::vector<EffectDefinition> definitions = [] {
    std::vector<EffectDefinition> found;
    for (auto family :
         {rigid_body_effects, friction_effects, presliding_effects, thermal_effects, position_effects,
          sensor_effects, transmission_effects, coupling_effects, contact_effects}) {
      for (EffectDefinition& definition : family()) found.push_back(std::move(definition));
    }
    return found;
  }();
  return definitions;
}

const EffectDefinition& effect_definition(const std::string& name) {
  effect_schema(name);  // throws where there is no such word
  for (const EffectDefinition& definition : effect_definitions())
    if (definition.name == name) return definition;
  throw Error("effect '" + name + "': cannot be simulated");
}

Eigen::VectorXd gravity_peaks(const Robot& robot, std::mt19937_64& random) {
  const Model<> model(robot);
  Workspace<> ws(model);
  const int n = robot.size();
  Eigen::VectorXd q(n), g(n), peak = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < 200; ++k) {
    for (int j = 0; j < n; ++j) {
      const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
      q[j] = uniform(random, std::max(limits.lower, -M_PI), std::min(limits.upper, M_PI));
    }
    gravity(model, ws, q, g);
    peak = peak.cwiseMax(g.cwiseAbs());
  }
  return peak;
}

}  // namespace detail

const std::vector<EffectDraw>& effect_draws(const std::string& name) {
  return detail::effect_definition(name).draws;
}

Effect draw_effect(const std::string& name, const Robot& robot, unsigned long seed, double strength,
                   double duration) {
  const detail::EffectDefinition& definition = detail::effect_definition(name);
  const EffectSchema& schema = effect_schema(name);
  const int n = robot.size();
  if (schema.scope == EffectScope::pair && n < 2)
    detail::refuse_effect(name, "the robot has one joint, it takes two");
  if (!(strength > 0.0) || !std::isfinite(strength)) detail::refuse_effect(name, "strength must be positive");
  std::vector<unsigned long> seeds = {seed};  // the name too: effects of one seed have nothing in common
  for (const char c : name) seeds.push_back(static_cast<unsigned char>(c));
  std::seed_seq sequence(seeds.begin(), seeds.end());
  std::mt19937_64 random(sequence);
  Effect effect;
  effect.name = name;
  if (schema.scope == EffectScope::link) {
    effect.joints = {std::uniform_int_distribution<int>(std::max(1, n - 4), n)(random)};
  } else if (schema.scope == EffectScope::joints) {
    std::vector<int> able;
    const Eigen::VectorXd peak = detail::gravity_peaks(robot, random);
    for (int j = 1; j <= n; ++j)
      if (peak[j - 1] >= definition.least_load * peak.maxCoeff()) able.push_back(j);
    std::shuffle(able.begin(), able.end(), random);
    const auto most = std::min<std::size_t>(3, able.size());
    able.resize(std::uniform_int_distribution<std::size_t>(1, most)(random));
    effect.joints = able;
    std::sort(effect.joints.begin(), effect.joints.end());
  }
  for (const EffectDraw& d : definition.draws) {
    const EffectParameter& p = schema.parameter(d.key);
    const auto draw = [&](std::size_t k) {
      double x = detail::uniform(random, d.low[k], d.high[k]);
      if (d.either_sign && random() % 2 == 0) x = -x;
      if (d.scale == EffectDraw::Scale::times) x *= strength;
      if (d.scale == EffectDraw::Scale::divided) x /= strength;
      return std::clamp(x, p.least, p.most);
    };
    std::vector<double>& values = effect.parameters[d.key];
    if (p.per_joint && d.once) {
      values = {draw(0)};
    } else if (p.per_joint) {
      values.assign(static_cast<std::size_t>(n), 0.0);
      for (const int joint : effect.joints) values[static_cast<std::size_t>(joint - 1)] = draw(0);
    } else {
      for (std::size_t k = 0; k < p.initial.size(); ++k) values.push_back(draw(k));
    }
  }
  if (definition.draw != nullptr) definition.draw(effect, robot, random, strength, duration);
  return complete_effect(effect, robot);
}

}  // namespace dynid
