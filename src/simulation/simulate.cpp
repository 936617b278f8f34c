// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/simulate.hpp"

#include <cmath>
#include <random>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/plant.hpp"
#include "rigid_body.hpp"

namespace dynid {
namespace {

constexpr double lost_robot =
    0.5;  // of the joint's travel, away from the motion: the controller has lost the robot

/// Stamps that come late and rows that repeat, as over a network.
void transmit(Log& log, const MeasurementOptions& options, unsigned long seed) {
  std::seed_seq sequence{seed, 0x7061636b65UL};
  std::mt19937_64 random(sequence);
  std::exponential_distribution<double> late;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (Eigen::Index i = 0; i < log.t.size(); ++i) {
    if (options.stamp_jitter > 0.0) {
      log.t[i] += options.stamp_jitter * late(random);
      if (i > 0) log.t[i] = std::max(log.t[i], log.t[i - 1] + 1e-6);  // in order
    }
    if (options.repeat_probability > 0.0 && uniform(random) < options.repeat_probability && i > 0)
      for (Eigen::MatrixXd* m : {&log.q, &log.dq, &log.tau}) m->row(i) = m->row(i - 1).eval();
  }
}

/// Why the controller may have lost the robot, and what to do.
std::string why_lost(const std::vector<Effect>& effects) {
  std::vector<std::string> names;
  for (const Effect& effect : effects) names.push_back(effect.name);
  if (names.empty()) return ": the controller cannot hold the model; are its inertias those of a body?";
  return ": the controller does not know of " + list_in_words(names) +
         " and cannot hold the arm so; less of it, or on fewer joints (dynid simulate --effects lists what "
         "it has)";
}

}  // namespace

SimulatedRun simulate(const Robot& nominal, const std::vector<Effect>& effects, const Trajectory& trajectory,
                      const SimulateOptions& options) {
  const int n = nominal.size();
  if (trajectory.joints() != n)
    throw Error(trajectory.source + ": the trajectory has " + std::to_string(trajectory.joints()) +
                " joints, the robot has " + std::to_string(n));
  if (trajectory.samples() < 2) throw Error(trajectory.source + ": the trajectory has no length");
  if (!(options.control_rate > 0.0) || !std::isfinite(options.control_rate) || !(options.rate > 0.0))
    throw Error("simulate: rates must be positive");
  const double ratio = options.control_rate / options.rate;
  const auto every = static_cast<Eigen::Index>(std::llround(ratio));
  if (every < 1 || std::abs(ratio - double(every)) > 1e-9 * ratio)
    throw Error("simulate: the log's rate of " + short_number(options.rate) +
                " Hz does not divide the control rate of " + short_number(options.control_rate) +
                " Hz: " + short_number(options.control_rate / std::ceil(std::max(1.0, ratio))) + " Hz would");

  SimulatedRun run;
  run.truth = perturbed(nominal, options.spread, options.seed);
  run.truth.effects.clear();
  for (const std::vector<Effect>* list : {&nominal.effects, &effects})
    for (const Effect& effect : *list) run.truth.effects.push_back(complete_effect(effect, nominal));
  PlantOptions plant_options;
  plant_options.measurement = options.measurement;
  plant_options.seed = options.seed;
  plant_options.integration_rate = options.integration_rate;
  Plant plant(run.truth, plant_options);
  ComputedTorque control(nominal, options.gains);
  detail::WholeTorque expected(nominal);
  Robot bare = run.truth;
  bare.effects.clear();
  detail::WholeTorque true_torque(bare);

  Eigen::VectorXd travel(n);
  const std::vector<JointScale> scales = joint_scales(nominal);
  for (int j = 0; j < n; ++j) travel[j] = scales[static_cast<std::size_t>(j)].travel;

  const double start = trajectory.t[0], duration = trajectory.t[trajectory.samples() - 1] - start;
  const auto steps = static_cast<Eigen::Index>(std::floor(duration * options.control_rate + 1e-6));
  const Eigen::Index rows = steps / every + 1;
  const double dt = 1.0 / options.control_rate;
  run.t.resize(rows);
  Log& log = run.log;
  log.source = "simulated";
  for (Eigen::MatrixXd* m : {&run.q, &run.dq, &run.ddq, &run.tau, &run.seen_q, &run.seen_dq, &run.seen_ddq,
                             &run.seen_tau, &log.q, &log.dq, &log.tau})
    m->resize(rows, n);
  if (options.record_command) log.tau_cmd.resize(rows, n);
  if (options.record_torques) {
    run.injected.assign(run.truth.effects.size(), Eigen::MatrixXd(rows, n));
    run.model_error.resize(rows, n);
  }

  Eigen::VectorXd q_d(n), dq_d(n), ddq_d(n), tau(n), other(n);
  Eigen::MatrixXd shares;
  sample(trajectory, start, q_d, dq_d, ddq_d);
  control(q_d, dq_d, ddq_d, q_d, dq_d, 0.0, tau);
  plant.reset(q_d, dq_d, tau);
  for (Eigen::Index k = 0; k <= steps; ++k) {
    sample(trajectory, start + double(k) * dt, q_d, dq_d, ddq_d);
    if (k % every == 0) {
      const Eigen::Index i = k / every;
      run.t[i] = double(k) * dt;
      run.q.row(i) = plant.q();
      run.dq.row(i) = plant.dq();
      run.ddq.row(i) = plant.ddq();
      run.tau.row(i) = plant.tau();
      run.seen_q.row(i) = plant.seen_q();
      run.seen_dq.row(i) = plant.seen_dq();
      run.seen_ddq.row(i) = plant.seen_ddq();
      run.seen_tau.row(i) = plant.seen_tau();
      log.q.row(i) = plant.measured_q();
      log.dq.row(i) = plant.measured_dq();
      log.tau.row(i) = plant.measured_tau();
      if (options.record_command) log.tau_cmd.row(i) = tau;
      if (options.record_torques) {
        plant.effect_torques(shares);
        for (std::size_t e = 0; e < run.injected.size(); ++e)
          run.injected[e].row(i) = shares.col(static_cast<Eigen::Index>(e));
        true_torque(plant.seen_q(), plant.seen_dq(), plant.seen_ddq(), other);
        run.model_error.row(i) = other;
        expected(plant.seen_q(), plant.seen_dq(), plant.seen_ddq(), other);
        run.model_error.row(i) -= other;
      }
      Eigen::Index worst = 0;
      if (!((plant.seen_q() - q_d).cwiseQuotient(travel).cwiseAbs().maxCoeff(&worst) < lost_robot))
        throw Error("simulate: joint " + std::to_string(worst + 1) + " left its motion at " +
                    std::to_string(run.t[i]) + " s" + why_lost(run.truth.effects));
    }
    if (k == steps) break;
    control(q_d, dq_d, ddq_d, plant.measured_q(), plant.measured_dq(), dt, tau);
    try {
      plant.step(tau, dt);
    } catch (const Error& error) {
      throw Error(error.what() + why_lost(run.truth.effects));
    }
  }
  log.t = run.t;
  if (options.record_acceleration) log.ddq = run.seen_ddq;
  transmit(log, options.measurement, options.seed);
  return run;
}

}  // namespace dynid
