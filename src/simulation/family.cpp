// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/family.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/measurement.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/random_motion.hpp"

namespace dynid {
namespace {

using Eigen::VectorXd;

class Dice {
 public:
  Dice(unsigned long seed, unsigned long purpose) {
    std::seed_seq sequence{seed, purpose};
    random_.seed(sequence);
  }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  bool chance(double p) { return uniform(0.0, 1.0) < p; }
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned long>(n)); }
  Eigen::Vector3d direction() {
    std::normal_distribution<double> normal;
    const double x = normal(random_), y = normal(random_), z = normal(random_);
    return Eigen::Vector3d(x, y, z).normalized();
  }

 private:
  std::mt19937_64 random_;
};

/// A body along a link: points about the way to the next joint, and a ball at its middle.
StandardParameters random_link(Dice& dice, const Eigen::Vector3d& way, double mass, double thickness) {
  StandardParameters p = StandardParameters::Zero();
  constexpr int points = 6;
  for (int k = 0; k < points; ++k) {
    LinkInertia point;
    point.mass = 0.7 * mass / points * dice.uniform(0.6, 1.4);
    point.com = dice.uniform(0.0, 1.0) * way + thickness * dice.uniform(0.2, 1.0) * dice.direction();
    p += to_standard(point);
  }
  LinkInertia ball;
  ball.mass = 0.3 * mass;
  ball.com = 0.4 * way;
  ball.inertia = 0.4 * ball.mass * thickness * thickness * Eigen::Matrix3d::Identity();
  return p + to_standard(ball);
}

/// Centre and half of the range of position of each joint.
void ranges_of(const Robot& robot, const std::vector<JointScale>& scales, VectorXd& centre, VectorXd& half) {
  const int n = robot.size();
  centre.setZero(n);
  half.setZero(n);
  for (int j = 0; j < n; ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const bool bounded = std::isfinite(limits.lower) && std::isfinite(limits.upper);
    if (bounded) centre[j] = 0.5 * (limits.lower + limits.upper);
    half[j] =
        bounded ? 0.5 * (limits.upper - limits.lower) : 0.4 * scales[static_cast<std::size_t>(j)].travel;
  }
}

// The arm that the ranges of the catalogue were written for: geometric means over the Panda's joints.
constexpr double reference_torque = 57.0;       // [N m] torque range
constexpr double reference_speed = 2.35;        // [rad/s]
constexpr double reference_acceleration = 2.4;  // [rad/s^2], as JointScale
constexpr double reference_travel = 4.6;        // [rad]
constexpr double reference_length = 1.2;        // [m], of the stretched arm

double length_of(const Robot& robot) {
  double length = robot.tip.translation().norm();
  for (std::size_t i = 1; i < robot.joints.size(); ++i) length += robot.joints[i].origin.translation().norm();
  const StandardParameters& last = robot.joints.back().parameters;
  if (last[0] > 0.0) length = std::max(length, last.segment<3>(1).norm() / last[0]);
  return length;
}

/// Ratios of a robot's quantities to the reference's.
struct Ratios {
  explicit Ratios(const Robot& robot) : scales(joint_scales(robot)), torque(torque_ranges(robot)) {
    length = std::max(length_of(robot) / reference_length, 1e-9);
    force = 0.0;
    constexpr double largest = 87.0;  // [N m], of the reference
    for (std::size_t j = 0; j < scales.size(); ++j) {
      const bool slides = scales[j].type == JointType::prismatic;
      const double range = torque[static_cast<Eigen::Index>(j)];
      force = std::max(force, range / largest * (slides ? reference_length : 1.0 / length));
    }
    torque /= reference_torque;
  }

  double of(const std::string& unit, std::size_t j) const {
    const JointScale& s = scales[j];
    const double u = torque[static_cast<Eigen::Index>(j)];
    const JointUnits& r = joint_units(JointType::revolute);
    if (unit == r.torque) return u;
    if (unit == r.position) return s.travel / reference_travel;
    if (unit == r.velocity) return s.speed / reference_speed;
    if (unit == r.stiffness) return u / (s.travel / reference_travel);
    if (unit == r.damping) return u / (s.speed / reference_speed);
    if (unit == r.inertia) return u / (s.acceleration / reference_acceleration);
    if (unit == r.per_position)  // teeth of a turn; of a rack, by its length
      return s.type == JointType::prismatic ? reference_travel / s.travel : 1.0;
    return of_arm(unit);
  }
  double of_arm(const std::string& unit) const {
    if (unit == "m") return length;
    if (unit == "kg" || unit == "N") return force;
    return 1.0;
  }

  std::vector<JointScale> scales;
  VectorXd torque;
  double length, force;
};

}  // namespace

Robot random_family_robot(unsigned long seed) {
  Dice dice(seed, 0x66616d696c79UL);
  Robot robot;
  robot.name = "family_" + std::to_string(seed);
  const int n = 1 + dice.below(7);
  const double size = dice.log_uniform(0.05, 20.0);
  const double arm_mass = dice.uniform(2.0, 8.0) * size * size;
  const double taper = dice.uniform(0.55, 0.9);
  const bool friction = dice.chance(0.7), rotors = dice.chance(0.6);
  std::vector<Eigen::Vector3d> ways;
  int sliding = 0;
  for (int i = 0; i < n; ++i) {
    Joint joint;
    joint.name = "joint_" + std::to_string(i + 1);
    joint.link_name = "link_" + std::to_string(i + 1);
    const bool slides = sliding < 3 && dice.chance(0.2);
    sliding += slides ? 1 : 0;
    joint.type = slides ? JointType::prismatic : JointType::revolute;
    // Axes at right angles, parallel, or anyhow. A lone joint lies down: else gravity would not be felt.
    const int turn = i == 0 && n <= 2 ? 1 : dice.below(7);
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    if (turn == 0) {
      R = Eigen::AngleAxisd(dice.uniform(-M_PI, M_PI), dice.direction()).toRotationMatrix();
    } else if (turn <= 4) {
      R = Eigen::AngleAxisd(turn % 2 == 0 ? 0.5 * M_PI : -0.5 * M_PI, Eigen::Vector3d::UnitX())
              .toRotationMatrix();
    }
    joint.origin.linear() = R;
    joint.origin.translation() = i == 0 ? Eigen::Vector3d(0.0, 0.0, 0.3 * size) : ways.back();
    // To the next joint: across the axis (an upper arm), along it, or hardly at all (a wrist).
    const double length = size * (dice.chance(0.3) ? dice.uniform(0.02, 0.08) : dice.uniform(0.15, 0.45));
    const double angle = dice.uniform(-M_PI, M_PI);
    Eigen::Vector3d way(std::cos(angle), std::sin(angle), dice.uniform(-0.5, 0.5));
    if (dice.chance(0.3)) way = {0.1 * way.x(), 0.1 * way.y(), 1.0};
    ways.emplace_back(length * way.normalized());
    const double mass = arm_mass * std::pow(taper, i) * dice.uniform(0.6, 1.4);
    joint.parameters = random_link(dice, ways.back(), mass, size * dice.uniform(0.03, 0.08));
    const double half = slides ? size * dice.uniform(0.1, 0.3) : dice.uniform(1.2, 2.9);
    const double centre = half * dice.uniform(-0.3, 0.3);
    joint.limits.lower = centre - half;
    joint.limits.upper = centre + half;
    // A shorter arm is quicker as a shorter pendulum is.
    joint.limits.velocity = dice.uniform(0.6, 1.4) * (slides ? 0.7 * std::sqrt(size) : 2.3 / std::sqrt(size));
    joint.limits.acceleration =
        dice.uniform(4.0, 8.0) * 2.0 * joint.limits.velocity * joint.limits.velocity / (2.0 * half);
    robot.joints.push_back(joint);
  }
  robot.tip.translation() = dice.uniform(0.3, 1.0) * ways.back();
  std::vector<JointScale> scales = joint_scales(robot);
  for (int i = 0; i < n; ++i) {
    const auto j = static_cast<std::size_t>(i);
    Joint& joint = robot.joints[j];
    const double part = dice.uniform(0.1, 0.8);
    if (rotors) joint.rotor_inertia = part * scales[j].inertia;
    const double rush = (scales[j].inertia + joint.rotor_inertia) * joint.limits.acceleration;
    joint.limits.torque = dice.uniform(1.3, 2.5) * (scales[j].gravity + rush);
  }
  const VectorXd range = torque_ranges(robot);
  for (int i = 0; i < n; ++i) {
    Joint& joint = robot.joints[static_cast<std::size_t>(i)];
    const double coulomb = dice.uniform(0.01, 0.05) * range[i], viscous = dice.uniform(0.01, 0.05) * range[i];
    if (!friction) continue;
    joint.friction.linear.coulomb = coulomb;
    joint.friction.linear.viscous = viscous / joint.limits.velocity;
    joint.friction.linear.velocity_scale = 2e-3 * joint.limits.velocity;
  }
  return robot;
}

FamilyRun random_family_run(unsigned long seed) {
  Dice dice(seed, 0x72756eUL);
  FamilyRun run;
  constexpr FamilyMotion motions[] = {FamilyMotion::exciting, FamilyMotion::pick_and_place,
                                      FamilyMotion::exciting, FamilyMotion::pick_and_place,
                                      FamilyMotion::slow};
  run.motion = motions[dice.below(5)];
  constexpr double rates[] = {30.0, 50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0};
  run.rate = rates[dice.below(8)];
  run.control_rate = run.rate * std::ceil(1000.0 / run.rate - 1e-9);
  run.duration = dice.log_uniform(6.0, 60.0);
  run.logs = 1 + dice.below(2);
  return run;
}

Trajectory pick_and_place_motion(const Robot& robot, double duration, unsigned long seed, double rate) {
  if (!(duration > 0.0) || !(rate > 0.0) || !std::isfinite(duration) || !std::isfinite(rate) ||
      !(duration * rate >= 2.0))
    throw Error("pick and place: duration and rate must be positive, and the motion have samples");
  const std::vector<JointScale> scales = joint_scales(robot);
  const int n = robot.size();
  Dice dice(seed, 0x7069636bUL);
  VectorXd centre, half;
  ranges_of(robot, scales, centre, half);
  const bool trapezoid = dice.chance(0.4);
  // Peaks of a move over unit distance in unit time: 10 s^3 - 15 s^4 + 6 s^5, and thirds of a trapezoid.
  const double peak_speed = trapezoid ? 1.5 : 1.875, peak_rush = trapezoid ? 4.5 : 10.0 / std::sqrt(3.0);
  const double pace = 0.9 * dice.uniform(0.5, 1.0);
  struct Move {
    double start, length;
    VectorXd from, to;
  };
  std::vector<Move> moves;
  VectorXd here = centre + 0.5 * half * dice.uniform(-1.0, 1.0);
  const VectorXd first = here;
  const double longest = duration / 4.0;  // at least two moves and their dwells
  for (double t = dice.uniform(0.02, 0.08) * duration;;) {
    VectorXd there(n);
    for (int j = 0; j < n; ++j) there[j] = centre[j] + 0.9 * half[j] * dice.uniform(-1.0, 1.0);
    double length = 0.0;
    for (int j = 0; j < n; ++j) {
      const JointScale& s = scales[static_cast<std::size_t>(j)];
      const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
      const double rush = std::isfinite(limits.acceleration) ? limits.acceleration : 6.0 * s.acceleration;
      const double way = std::abs(there[j] - here[j]);
      length =
          std::max({length, peak_speed * way / (pace * s.speed), std::sqrt(peak_rush * way / (pace * rush))});
    }
    if (length > longest) {  // a shorter way at the same acceleration
      there = here + (there - here) * std::pow(longest / length, 2);
      length = longest;
    }
    if (t + length > duration) break;
    moves.push_back({t, length, here, there});
    here = there;
    t += length * (1.0 + dice.uniform(0.2, 1.5));
  }
  Trajectory motion;
  motion.source = "pick and place " + std::to_string(seed);
  const auto samples = static_cast<Eigen::Index>(std::floor(duration * rate + 1e-6)) + 1;
  motion.t = VectorXd::LinSpaced(samples, 0.0, double(samples - 1) / rate);
  motion.q.resize(samples, n);
  motion.dq.setZero(samples, n);
  motion.ddq.setZero(samples, n);
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < samples; ++i) {
    const double t = motion.t[i];
    while (k < moves.size() && t >= moves[k].start + moves[k].length) ++k;
    if (k >= moves.size() || t <= moves[k].start) {
      motion.q.row(i) = k == 0 ? first : moves[k - 1].to;
      continue;
    }
    const Move& move = moves[k];
    const double T = move.length, s = (t - move.start) / T;
    double x, v, a;
    if (!trapezoid) {
      x = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
      v = 30.0 * s * s * (1.0 - s) * (1.0 - s);
      a = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s);
    } else if (s < 1.0 / 3.0) {
      x = 2.25 * s * s, v = 4.5 * s, a = 4.5;
    } else if (s < 2.0 / 3.0) {
      x = 0.25 + 1.5 * (s - 1.0 / 3.0), v = 1.5, a = 0.0;
    } else {
      x = 1.0 - 2.25 * (1.0 - s) * (1.0 - s), v = 4.5 * (1.0 - s), a = -4.5;
    }
    const VectorXd way = move.to - move.from;
    motion.q.row(i) = move.from + x * way;
    motion.dq.row(i) = v / T * way;
    motion.ddq.row(i) = a / (T * T) * way;
  }
  return motion;
}

Trajectory family_motion(const Robot& robot, const FamilyRun& run, unsigned long seed) {
  if (run.motion == FamilyMotion::pick_and_place)
    return pick_and_place_motion(robot, run.duration, seed, run.control_rate);
  RandomMotionOptions options;
  options.rate = run.control_rate;
  // The frequency at which the joints sweep their travel, as the Panda's 0.075 Hz is; five harmonics of it
  // are still sampled by a log, and a slow motion takes three times as long for a fifth of the travel.
  std::vector<double> sweeps;
  for (const JointScale& s : joint_scales(robot)) sweeps.push_back(s.speed / s.travel);
  std::sort(sweeps.begin(), sweeps.end());
  const double sweep = sweeps[sweeps.size() / 2] / (reference_speed / reference_travel);
  options.base_frequency = std::min(0.075 * sweep, 0.008 * run.rate);
  if (run.motion == FamilyMotion::slow) {
    options.base_frequency /= 3.0;
    options.margin = 0.2;
  }
  return random_motion(robot, run.duration, seed, options);
}

Effect draw_family_effect(const std::string& name, const Robot& robot, unsigned long seed, double strength,
                          double duration) {
  Effect effect = draw_effect(name, robot, seed, strength, duration);
  const Ratios ratios(robot);
  Dice dice(seed, 0x6566666563UL);
  const EffectSchema& schema = effect_schema(name);
  if (schema.scope == EffectScope::pair) {
    const auto& joints = robot.joints;
    const auto a = static_cast<std::size_t>(effect.joints[0] - 1),
               b = static_cast<std::size_t>(effect.joints[1] - 1);
    if ((joints[a].type == JointType::prismatic) != (joints[b].type == JointType::prismatic))
      throw Error("effect '" + name + "': its two joints are of different types");
  }
  for (const EffectParameter& p : schema.parameters) {
    const auto found = effect.parameters.find(p.key);
    if (found == effect.parameters.end()) continue;  // of another form
    std::vector<double>& values = found->second;
    if (name == "torque_saturation") break;  // drawn from the robot's own gravity
    if (p.per_joint) {
      for (const int joint : effect.joints)
        values[static_cast<std::size_t>(joint - 1)] *= ratios.of(p.unit, static_cast<std::size_t>(joint - 1));
      continue;
    }
    // One for several joints: the smallest of theirs. Of the whole arm, or a body: of the arm.
    double ratio = ratios.of_arm(p.unit);
    if (schema.scope == EffectScope::joints || schema.scope == EffectScope::pair) {
      ratio = HUGE_VAL;
      for (const int joint : effect.joints)
        ratio = std::min(ratio, ratios.of(p.unit, static_cast<std::size_t>(joint - 1)));
    }
    for (double& x : values) x *= ratio;
  }
  if (name == "link_inertial_error") {  // a part of the link, more where the link is light for its arm
    const double mass =
        from_standard(robot.joints[static_cast<std::size_t>(effect.joints[0] - 1)].parameters).mass;
    double change = strength * dice.uniform(0.5, 1.0) * std::max(0.5 * mass, 0.8 * ratios.force);
    if (dice.chance(0.5) && mass - change > 0.3 * mass) change = -change;
    effect.parameters["mass"] = {change};
  } else if (name == "joint_spring") {  // at rest within the travel
    for (const int joint : effect.joints) {
      const auto j = static_cast<std::size_t>(joint - 1);
      const JointLimits& limits = robot.joints[j].limits;
      if (std::isfinite(limits.lower) && std::isfinite(limits.upper))
        effect.parameters["rest"][j] += 0.5 * (limits.lower + limits.upper);
    }
  } else if (name == "external_contact") {
    effect.joints.clear();  // complete_effect() finds them by the link
  }
  return complete_effect(effect, robot);
}

Robot as_a_vendor_says(const Robot& robot, double spread, unsigned long seed) {
  Robot nominal = perturbed(robot, spread, seed);
  nominal.effects.clear();
  for (Joint& joint : nominal.joints) {
    joint.friction = {};
    joint.rotor_inertia = 0.0;
  }
  return nominal;
}

}  // namespace dynid
