// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/servo_plant.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/effect/complete.hpp"
#include "dynid/effect/servo_effects.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/plant.hpp"
#include "rigid_body.hpp"

namespace dynid {
namespace {

using Eigen::VectorXd;

constexpr double lost = 2.0;  // travels away from the command: the servo has lost the joint

void check(const Robot& robot, const Trajectory& commands, const SimulateServosOptions& o) {
  validate(robot);
  bool si = false, ratios = false;
  for (const Joint& joint : robot.joints) {
    if (!joint.servo)
      throw Error("robot '" + robot.name + "': joint '" + joint.name +
                  "' has no servo: commands need one on every joint (`servo:` in the model, position "
                  "actuators in an MJCF, or dynid identify --servo)");
    (joint.servo->kp > 0.0 ? si : ratios) = true;
  }
  if (si && ratios)
    throw Error(
        "robot '" + robot.name +
        "': some servos have kp, others ratios only: the torques that couple such joints are unknown");
  if (commands.joints() != robot.size())
    throw Error(commands.source + ": the trajectory has " + std::to_string(commands.joints()) +
                " joints, the robot has " + std::to_string(robot.size()));
  if (commands.samples() < 2) throw Error(commands.source + ": the trajectory has no length");
  for (const double x : {o.rate, o.servo_rate})
    if (!(x > 0.0) || !std::isfinite(x)) throw Error("simulate: rates must be positive");
  for (const double x : {o.encoder_step, o.noise, o.settle})
    if (!(x >= 0.0) || !std::isfinite(x)) throw Error("simulate: a size of the measurement is negative");
}

/// Joints that stand alone, torques over kp.
Robot over_stiffness(Robot robot) {
  if (robot.joints.front().servo->kp > 0.0) return robot;
  for (Joint& joint : robot.joints) {
    Servo& s = *joint.servo;
    joint.parameters.setZero();
    joint.friction = {};
    joint.rotor_inertia = 1.0 / (s.natural_frequency * s.natural_frequency);
    s.kp = 1.0;
    s.kd = 2.0 * s.damping_ratio / s.natural_frequency;
    joint.friction.linear.coulomb = s.coulomb_position;
    s.torque_limit = s.error_limit;
    const Servo none;
    s.natural_frequency = none.natural_frequency, s.damping_ratio = none.damping_ratio;
    s.coulomb_position = none.coulomb_position, s.error_limit = none.error_limit;
  }
  return robot;
}

/// What the servos take from effects beside their own numbers.
struct Drives {
  VectorXd half_gap, compensation;  // [rad]; part of the gravity torque
  VectorXd damping;                 // [N m s/rad] that the servo itself gives; the rest of kd is the plant's
};

/// Friction with the load feels what the servo gives, damping included: there kd is the servo's own.
/// Elsewhere the plant has it, whose integration takes any.
VectorXd damping_in_servo(const Robot& truth, const std::vector<Effect>& left) {
  VectorXd damping = VectorXd::Zero(truth.size());
  for (int j = 0; j < truth.size(); ++j) {
    const Servo& s = *truth.joints[static_cast<std::size_t>(j)].servo;
    bool felt = s.load_friction > 0.0;
    for (const Effect& e : left)
      felt = felt || (e.name == "load_dependent_friction" &&
                      std::find(e.joints.begin(), e.joints.end(), j + 1) != e.joints.end());
    if (felt) damping[j] = s.kd;
  }
  return damping;
}

/// Cycles of the servo in `interval` [s]: enough for the damping that it gives.
int cycles_of(const Robot& truth, const Drives& drives, const VectorXd& q, double interval, double rate) {
  constexpr double resolved = 0.2, most = 2e5;  // of a time constant; [Hz]
  const Model<> model(truth);
  Workspace<> ws(model);
  Eigen::MatrixXd M(truth.size(), truth.size());
  mass_matrix(model, ws, q, M);
  M.diagonal() += detail::rotor_inertias(truth);
  const VectorXd mobility = M.inverse().diagonal();
  for (Eigen::Index j = 0; j < q.size(); ++j)
    rate = std::max(rate, drives.damping[j] * mobility[j] / resolved);
  if (!(rate <= most))
    throw Error("simulate: a servo's damping is too stiff beside friction with the load for its inertia");
  return std::max(1, static_cast<int>(std::ceil(rate * interval - 1e-6)));
}

/// Servo numbers that are torques at the joint become laws of the plant.
Robot plant_of(const Robot& truth, const std::vector<Effect>& left, const VectorXd& damping_in_servo) {
  Robot plant = truth;
  plant.effects = left;
  const std::vector<JointScale> scales = joint_scales(truth);
  const auto n = static_cast<std::size_t>(truth.size());
  for (std::size_t j = 0; j < n; ++j) {
    Joint& joint = plant.joints[j];
    const Servo& s = *joint.servo;
    joint.friction.linear.viscous += s.kd - damping_in_servo[static_cast<Eigen::Index>(j)];
    const double width = detail::least_velocity_scale * scales[j].speed;
    const auto of_joint = [&](double x) {
      std::vector<double> all(n, 0.0);
      all[j] = x;
      return all;
    };
    const std::vector<int> here = {static_cast<int>(j) + 1};
    if (s.stribeck_position > 0.0)
      plant.effects.push_back(complete_effect({"stribeck_friction",
                                               here,
                                               {{"static", of_joint(s.kp * s.stribeck_position)},
                                                {"stribeck_velocity", of_joint(s.stribeck_velocity)},
                                                {"velocity_scale", of_joint(width)}}},
                                              truth));
    if (s.load_friction > 0.0)
      plant.effects.push_back(
          complete_effect({"load_dependent_friction",
                           here,
                           {{"coefficient", of_joint(s.load_friction)}, {"velocity_scale", of_joint(width)}}},
                          truth));
  }
  return plant;
}

/// Commands of the whole run by row, and when each is heard.
class Channel {
 public:
  Channel(const Eigen::MatrixXd& u, double rate) : u_(u), rate_(rate) {}
  /// Of joint `j` at time `t`.
  double at(int j, double t) const {
    const double row = std::floor(t * rate_ + 1e-9);
    return u_(static_cast<Eigen::Index>(std::clamp(row, 0.0, double(u_.rows() - 1))), j);
  }

 private:
  const Eigen::MatrixXd& u_;
  double rate_;
};

}  // namespace

VectorXd encoder_steps(const Robot& robot, double step) {
  VectorXd steps(robot.size());
  const std::vector<JointScale> scales = joint_scales(robot);
  for (int j = 0; j < robot.size(); ++j) {
    const JointScale& s = scales[static_cast<std::size_t>(j)];
    steps[j] = s.type == JointType::prismatic ? step * s.travel / (2.0 * M_PI) : step;
  }
  return steps;
}

Robot perturbed_servos(const Robot& robot, double spread, unsigned long seed) {
  Robot other = perturbed(robot, spread, seed);
  if (spread == 0.0) return other;
  std::seed_seq sequence{seed, 0x736572766fUL};
  std::mt19937_64 random(sequence);
  std::normal_distribution<double> normal;
  for (Joint& joint : other.joints) {
    if (!joint.servo) continue;
    joint.servo->kp *= 1.0 + spread * normal(random);
    joint.servo->kd *= 1.0 + spread * normal(random);
  }
  return other;
}

ServoRun simulate_servos(const Robot& robot, const std::vector<Effect>& effects, const Trajectory& commands,
                         const SimulateServosOptions& options) {
  check(robot, commands, options);
  const int n = robot.size();
  const Robot nominal = over_stiffness(robot);
  ServoRun run;
  run.truth = perturbed_servos(nominal, options.spread, options.seed);
  run.truth.effects.clear();
  Drives drives = {VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n)};
  std::vector<Effect> left;
  const auto put = [&](const Effect& effect) {
    if (effect.name == "gravity_compensation") {
      for (const int j : effect.joints) drives.compensation[j - 1] += joint_number(effect, "part", j - 1);
    } else if (effect.name == "backlash") {
      for (const int j : effect.joints) {
        if (joint_number(effect, "dead_zone", j - 1) != 0.0)
          throw Error("effect 'backlash': dead_zone: a servo's play is a gap");
        drives.half_gap[j - 1] += 0.5 * joint_number(effect, "gap", j - 1);
      }
    } else if (!enter_servo(run.truth, effect)) {
      left.push_back(complete_effect(effect, nominal));
    }
  };
  for (const Effect& effect : robot.effects) put(effect);
  for (const Effect& effect : effects) {
    put(effect);
    run.hidden.push_back(effect);
  }
  run.truth.effects = left;
  drives.damping = damping_in_servo(run.truth, left);

  PlantOptions plant_options;
  plant_options.seed = options.seed;
  plant_options.interpolate_torque = false;  // a digital drive holds what it gives
  plant_options.integration_rate = options.servo_rate;
  plant_options.measurement.encoder_resolution = options.encoder_step;
  plant_options.measurement.velocity_cutoff = options.encoder_step > 0.0 ? 20.0 : 0.0;
  Plant plant(plant_of(run.truth, left, drives.damping), plant_options);

  // Commands at the log's rows.
  const double start = commands.t[0], duration = commands.t[commands.samples() - 1] - start;
  const auto rows = static_cast<Eigen::Index>(std::floor(duration * options.rate + 1e-6)) + 1;
  Log& log = run.log;
  log.source = "simulated";
  log.t.resize(rows);
  for (Eigen::MatrixXd* m : {&log.u, &log.q, &log.dq, &run.q, &run.dq, &run.tau}) m->resize(rows, n);
  VectorXd q(n), dq(n), ddq(n);
  for (Eigen::Index i = 0; i < rows; ++i) {
    log.t[i] = double(i) / options.rate;
    sample(commands, start + log.t[i], q, dq, ddq);
    log.u.row(i) = q;
  }

  const Model<> model(nominal);
  Workspace<> ws(model);
  const Channel channel(log.u, options.rate);
  const int cycles = cycles_of(run.truth, drives, log.u.row(0), 1.0 / options.rate, options.servo_rate);
  const double h = 1.0 / (options.rate * cycles);
  VectorXd filtered = log.u.row(0), tau(n), weight = VectorXd::Zero(n), travel(n);
  const std::vector<JointScale> scales = joint_scales(nominal);
  for (int j = 0; j < n; ++j) travel[j] = scales[static_cast<std::size_t>(j)].travel;
  const bool compensated = drives.compensation.any();
  const auto servo_cycle = [&](double t) {
    if (compensated) gravity(model, ws, plant.seen_q(), weight);
    for (int j = 0; j < n; ++j) {
      const Servo& s = *run.truth.joints[static_cast<std::size_t>(j)].servo;
      const double u = channel.at(j, t + 0.5 * h - s.delay);  // the middle of what is held
      const double lag = s.command_time_constant;
      filtered[j] = lag > 0.0 ? u + (filtered[j] - u) * std::exp(-h / lag) : u;
      double e = filtered[j] - s.bias - plant.seen_q()[j];
      e = std::abs(e) <= drives.half_gap[j] ? 0.0 : e - std::copysign(drives.half_gap[j], e);
      tau[j] = std::clamp(s.kp * e, -s.torque_limit, s.torque_limit) + drives.compensation[j] * weight[j] -
               drives.damping[j] * plant.seen_dq()[j];
    }
    if (options.disturbance) options.disturbance(t, plant.seen_q(), plant.seen_dq(), tau);
    plant.step(tau, h);
  };

  gravity(model, ws, filtered, weight);
  plant.reset(filtered, VectorXd::Zero(n), weight);
  for (auto k = static_cast<long>(std::ceil(options.settle / h)); k > 0; --k) servo_cycle(-double(k) * h);
  const VectorXd step = encoder_steps(nominal, options.encoder_step);
  std::seed_seq sequence{options.seed, 0x656e636f646572UL};
  std::mt19937_64 random(sequence);
  std::normal_distribution<double> normal;
  for (Eigen::Index i = 0; i < rows; ++i) {
    run.q.row(i) = plant.q();
    run.dq.row(i) = plant.dq();
    for (int j = 0; j < n; ++j) {
      const double seen = plant.seen_q()[j];
      log.q(i, j) =
          step[j] > 0.0 ? step[j] * std::round(seen / step[j] + options.noise * normal(random)) : seen;
      if (!(std::abs(seen - log.u(i, j)) < lost * travel[j]))
        throw Error("simulate: joint " + std::to_string(j + 1) + " left its commands at " +
                    std::to_string(log.t[i]) + " s");
    }
    log.dq.row(i) = plant.measured_dq();
    if (i + 1 < rows)
      for (int c = 0; c < cycles; ++c) {
        servo_cycle(log.t[i] + c * h);
        if (c == 0) run.tau.row(i) = tau;
      }
    else
      run.tau.row(i) = tau;
    for (int j = 0; j < n; ++j)
      run.tau(i, j) -=
          (run.truth.joints[static_cast<std::size_t>(j)].servo->kd - drives.damping[j]) * run.dq(i, j);
  }
  if (options.record_torque) log.tau = run.tau;
  return run;
}

}  // namespace dynid
