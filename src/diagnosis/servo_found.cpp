// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include "dynid/dynamics/joint_scale.hpp"
#include "servo_judge.hpp"

namespace dynid::detail {
namespace {

constexpr double quantile = 1.645;  // of a normal number: 90 % two-sided

/// Probability that something is not nought, by its own standard deviation.
double not_nought(double value, double deviation) {
  return deviation > 0.0 ? std::erf(std::abs(value) / deviation / std::sqrt(2.0)) : 1.0;
}

/// Mean squared motion error over all rows of a joint.
double motion_energy(const ServoProblemOfJoint& p, const Knobs& x) {
  double sum = 0.0;
  Eigen::Index count = 0;
  for (const ServoRows& rows : p.rows) {
    sum += (servo_motion(p, x, rows) - rows.series.q).squaredNorm();
    count += rows.series.q.size();
  }
  return count > 0 ? sum / double(count) : 0.0;
}

/// Shares of the names in the energy explained: the average over all orders in which they may be added.
std::map<std::string, double> shares_of(const std::vector<ServoAnswer>& answers, const ServoPayload& payload,
                                        const Eigen::VectorXd& before,
                                        std::map<std::string, double>& of_a_joint) {
  std::map<std::string, double> shares;
  double sum = 0.0;
  for (std::size_t j = 0; j < answers.size() && payload.present; ++j) {
    const ServoAnswer& a = answers[j];
    const double floor = a.problem.floor, was = before[static_cast<Eigen::Index>(j)],
                 gone = (was * was - motion_energy(a.problem, a.problem.nominal)) / (floor * floor);
    shares["payload"] += std::max(0.0, gone);
    sum += std::max(0.0, gone);
  }
  for (const ServoAnswer& a : answers) {
    const std::size_t count = a.effects.size(), subsets = std::size_t{1} << count;
    if (count == 0) continue;
    std::vector<double> energy(subsets, 0.0);
    for (std::size_t s = 0; s < subsets; ++s) {
      std::vector<int> in;
      for (std::size_t k = 0; k < count; ++k)
        if ((s >> k & 1U) != 0) in.push_back(a.effects[k]);
      energy[s] = motion_energy(a.problem, only(a.problem.nominal, a.fit.x, in)) /
                  (a.problem.floor * a.problem.floor);
      // A part of the set may move far worse than none, without end: it explains nothing, and no less.
      energy[s] = std::min(energy[s], energy.front());
    }
    // The payload's part on this joint is explained too.
    const double was = before[static_cast<Eigen::Index>(&a - answers.data())] / a.problem.floor;
    const double by_payload = payload.present ? std::max(0.0, was * was - energy.front()) : 0.0;
    const double explained = std::max(energy.front() - energy.back(), 1e-300) + by_payload;
    const auto factorial = [](std::size_t k) { return std::tgamma(double(k) + 1.0); };
    for (std::size_t k = 0; k < count; ++k) {
      double share = 0.0;
      for (std::size_t s = 0; s < subsets; ++s) {
        if ((s >> k & 1U) != 0) continue;
        std::size_t size = 0;
        for (std::size_t i = 0; i < count; ++i) size += s >> i & 1U;
        share += factorial(size) * factorial(count - size - 1) / factorial(count) *
                 (energy[s] - energy[s | std::size_t{1} << k]);
      }
      share = std::max(0.0, share);
      double& own = of_a_joint[effect_of(a.effects[k]).name];
      own = std::max(own, share / explained);
      shares[effect_of(a.effects[k]).name] += share;
      sum += share;
    }
  }
  for (auto& [name, share] : shares) share = sum > 0.0 ? share / sum : 0.0;
  return shares;
}

std::string unit_on(const Robot& robot, std::size_t joint, const std::string& unit) {
  return unit_for(robot.joints[joint].type, unit);
}

void add_value(FoundEffect& found, const Robot& robot, std::size_t joint, const KnobWord& word, double value,
               double spread) {
  const auto n = static_cast<Eigen::Index>(robot.joints.size());
  auto at = std::find_if(found.parameters.begin(), found.parameters.end(),
                         [&](const ParameterEstimate& p) { return p.key == word.key; });
  if (at == found.parameters.end()) {
    ParameterEstimate p;
    p.key = word.key;
    p.unit = unit_on(robot, joint, word.unit);
    p.value = p.low = p.high = Eigen::VectorXd::Zero(n);
    p.per_joint = true;
    found.parameters.push_back(p);
    at = found.parameters.end() - 1;
  }
  const auto j = static_cast<Eigen::Index>(joint);
  at->value[j] = value;
  at->low[j] = value - quantile * spread;
  at->high[j] = value + quantile * spread;
}

/// One part for the whole arm, of joints that say it each with its own accuracy.
void pool(ParameterEstimate& p) {
  double weights = 0.0, sum = 0.0;
  for (Eigen::Index j = 0; j < p.value.size(); ++j) {
    const double spread = (p.high[j] - p.value[j]) / quantile;
    if (!(spread > 0.0)) continue;
    weights += 1.0 / (spread * spread);
    sum += p.value[j] / (spread * spread);
  }
  const double value = sum / weights, half = quantile / std::sqrt(weights);
  p.value = Eigen::VectorXd::Constant(1, value);
  p.low = Eigen::VectorXd::Constant(1, value - half);
  p.high = Eigen::VectorXd::Constant(1, value + half);
  p.per_joint = false;
}

}  // namespace

std::vector<FoundEffect> found_servo_effects(const Robot& nominal, const std::vector<ServoAnswer>& answers,
                                             const ServoPayload& payload, const Eigen::VectorXd& before,
                                             const ServoCriteria& criteria) {
  std::map<std::string, double> of_a_joint;
  const std::map<std::string, double> shares = shares_of(answers, payload, before, of_a_joint);
  std::vector<FoundEffect> out;
  for (const std::string& name : servo_effect_names()) {
    FoundEffect found;
    found.effect.name = name;
    const auto share = shares.find(name);
    if (share == shares.end() || of_a_joint[name] < criteria.least_share) continue;
    found.share = share->second;
    double weight = 0.0;
    for (std::size_t j = 0; j < answers.size(); ++j) {
      const ServoAnswer& a = answers[j];
      for (std::size_t k = 0; k < a.effects.size(); ++k) {
        const ServoEffect& effect = effect_of(a.effects[k]);
        if (name != effect.name) continue;
        found.effect.joints.push_back(static_cast<int>(j) + 1);
        // Of several joints the one that shows it most says most of whether it is there.
        const double own = std::max(1.0, weighed(a, a.effects[k]).gain);
        for (const std::string& alias : a.aliases[k])
          if (std::find(found.aliases.begin(), found.aliases.end(), alias) == found.aliases.end())
            found.aliases.push_back(alias);
        const bool si = nominal.joints[j].servo->kp > 0.0;
        const Eigen::MatrixXd covariance = knob_covariance(a.problem, a.fit, freed(a.effects), a.samples);
        const std::vector<Knob> free = freed(a.effects);
        // No surer than that its size is not none.
        const Knob size = effect.free.front();
        const auto at_size = std::find(free.begin(), free.end(), size) - free.begin();
        const double there = not_nought(a.fit.x[at(size)] - a.problem.nominal[at(size)],
                                        std::sqrt(std::max(0.0, covariance(at_size, at_size))));
        found.probability += own * std::min(a.probability[k], there);
        weight += own;
        for (const KnobWord& word : words_of(effect, si)) {
          const auto at_knob = std::find(free.begin(), free.end(), word.knob) - free.begin();
          const double value = a.fit.x[at(word.knob)] - (word.added ? a.problem.nominal[at(word.knob)] : 0.0);
          const double times = word.knob == Knob::backlash ? 2.0 : 1.0;  // a gap is from end to end
          add_value(found, nominal, j, word, times * value,
                    times * std::hypot(std::sqrt(std::max(0.0, covariance(at_knob, at_knob))),
                                       criteria.form_of_size * value));
        }
        if (effect.free.front() == Knob::spring) {
          const double stiffness = a.fit.x[at(Knob::spring)] - a.problem.nominal[at(Knob::spring)],
                       shift = a.fit.x[at(Knob::bias)] - a.problem.nominal[at(Knob::bias)];
          add_value(found, nominal, j, {Knob::bias, "rest", "rad", true},
                    -a.fit.x[at(Knob::kp)] * shift / stiffness,
                    a.fit.x[at(Knob::kp)] *
                        std::sqrt(std::max(0.0, covariance(free.size() - 1, free.size() - 1))) /
                        std::abs(stiffness));
        }
      }
    }
    found.probability /= weight;
    if (name == "gravity_compensation") pool(found.parameters.front());
    for (const ParameterEstimate& p : found.parameters)
      found.effect.parameters[p.key] = {p.value.data(), p.value.data() + p.value.size()};
    out.push_back(std::move(found));
  }
  if (payload.present && shares.at("payload") >= criteria.least_share) {
    FoundEffect found;
    found.effect.name = "payload";
    for (int j = 1; j <= nominal.size(); ++j) found.effect.joints.push_back(j);
    double there = 0.0;
    for (Eigen::Index k = 0; k < 4; ++k)
      there = std::max(there, not_nought(payload.value[k], std::sqrt(payload.covariance(k, k))));
    found.probability = std::min(payload.probability, there);
    found.share = shares.at("payload");
    const auto add = [&](const char* key, const char* unit, const Eigen::VectorXd& value,
                         const Eigen::VectorXd& spread) {
      found.parameters.push_back(
          {key, unit, value, value - quantile * spread, value + quantile * spread, false});
      found.effect.parameters[key] = {value.data(), value.data() + value.size()};
    };
    const double mass = payload.value[0];
    add("mass", "kg", Eigen::VectorXd::Constant(1, mass),
        Eigen::VectorXd::Constant(1, std::sqrt(payload.covariance(0, 0))));
    const Eigen::Vector3d com = payload.value.tail<3>() / mass;
    Eigen::VectorXd spread(3);
    for (int k = 0; k < 3; ++k) {
      Eigen::Vector4d slope = Eigen::Vector4d::Zero();
      slope[0] = -com[k] / mass;
      slope[k + 1] = 1.0 / mass;
      spread[k] = std::sqrt(std::max(0.0, slope.dot(payload.covariance * slope)));
    }
    add("com", "m", com, spread);
    out.push_back(std::move(found));
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const FoundEffect& a, const FoundEffect& b) { return a.share > b.share; });
  return out;
}

}  // namespace dynid::detail

namespace dynid {

Robot patched_servos(const Robot& nominal, const std::vector<FoundEffect>& effects) {
  using namespace detail;
  Robot robot = nominal;
  const auto n = static_cast<std::size_t>(nominal.size());
  std::vector<Knobs> was, now;
  for (std::size_t j = 0; j < n; ++j) was.push_back(knobs_of(nominal, static_cast<int>(j)));
  now = was;
  double compensated = 0.0;
  for (const FoundEffect& found : effects) {
    const auto of = [&](const char* key) -> const std::vector<double>& {
      return found.effect.parameters.at(key);
    };
    if (found.effect.name == "payload") {
      ServoPayload payload;
      payload.value[0] = of("mass")[0];
      for (int k = 0; k < 3; ++k)
        payload.value[k + 1] = payload.value[0] * of("com")[static_cast<std::size_t>(k)];
      robot.joints.back().parameters += payload.parameters();
      continue;
    }
    if (found.effect.name == "gravity_compensation") {
      compensated = of("part")[0];
      continue;
    }
    for (const ServoEffect& effect : servo_effects()) {
      if (found.effect.name != effect.name) continue;
      for (const int number : found.effect.joints) {
        const auto j = static_cast<std::size_t>(number - 1);
        for (const KnobWord& word : words_of(effect, nominal.joints[j].servo->kp > 0.0)) {
          const double value = of(word.key)[j];
          double& knob = now[j][at(word.knob)];
          knob = word.knob == Knob::backlash ? 0.5 * value : word.added ? knob + value : value;
        }
        if (effect.free.front() == Knob::spring)
          now[j][at(Knob::bias)] -= of("stiffness")[j] * of("rest")[j] / now[j][at(Knob::kp)];
      }
    }
  }
  for (std::size_t j = 0; j < n; ++j) turn(robot, static_cast<int>(j), was[j], now[j]);
  robot.gravity *= 1.0 - compensated;
  return robot;
}

}  // namespace dynid
