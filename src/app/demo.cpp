// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/demo.hpp"

#include <cmath>

#include "app/job.hpp"
#include "app/torque_table.hpp"
#include "dynid/app/simulate.hpp"
#include "dynid/base/error.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

// Supplementary Table II of Gaz et al. 2019: q_j(t) = sum_l a_lj / (l w) sin(l w t) - b_lj / (l w) cos(l w t)
// + q0_j.
constexpr int joints = 7, harmonics = 5;
constexpr double base_frequency = 0.15 * M_PI;  // [rad/s]
constexpr double a[harmonics][joints] = {{-0.2031, -0.0699, 0.3076, 0.1269, -0.2773, 0.2100, -0.2273},
                                         {0.1295, -0.5380, 0.5864, -0.0253, -0.0857, -0.1194, -0.5636},
                                         {-0.0090, -0.2015, -0.4813, -0.2405, 0.4810, -0.0950, -0.2099},
                                         {0.2319, -0.5535, -0.1228, 0.2178, 0.5311, -0.0964, 0.5725},
                                         {-0.7598, 0.2352, -0.5273, 0.6984, -0.1639, -0.0399, -0.3748}};
constexpr double b[harmonics][joints] = {{-0.1136, -0.2437, 0.3898, 0.0401, 0.5491, 0.0692, 0.2023},
                                         {0.6600, 0.1820, -0.0268, -0.1503, 0.1046, -0.6946, -0.2570},
                                         {-0.1858, -0.2390, 0.0179, 0.2359, 0.0407, -0.4442, -0.5010},
                                         {0.1867, -0.2647, 0.4767, -0.2022, -0.0432, -0.5749, 0.0774},
                                         {0.2357, 0.4252, 0.2726, 0.3693, 0.2448, -0.0698, -0.4833}};
constexpr double q0[joints] = {-0.5850, -0.1744, -0.3373, -1.8767, -1.0631, 1.7917, -0.7284};

/// 21 s of that motion.
Trajectory letters_motion() {
  Trajectory motion;
  motion.source = "the letter's motion";
  motion.t = Eigen::VectorXd::LinSpaced(21001, 0.0, 21.0);
  motion.q = motion.dq = motion.ddq = Eigen::MatrixXd::Zero(motion.t.size(), joints);
  for (int j = 0; j < joints; ++j) {
    motion.q.col(j).setConstant(q0[j]);
    for (int l = 0; l < harmonics; ++l) {
      const double w = (l + 1) * base_frequency;
      const Eigen::ArrayXd c = (w * motion.t).array().cos(), s = (w * motion.t).array().sin();
      motion.q.col(j).array() += (a[l][j] * s - b[l][j] * c) / w;
      motion.dq.col(j).array() += a[l][j] * c + b[l][j] * s;
      motion.ddq.col(j).array() += w * (b[l][j] * c - a[l][j] * s);
    }
  }
  return motion;
}

/// The log that the simulated robot's electronics give of it.
Log record(const Robot& robot, unsigned long seed) {
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.seed = seed;
  options.record_torques = false;
  return simulate(robot, {}, letters_motion(), options).log;
}

}  // namespace

DemoReport run(const DemoJob& job, const Context& context) {
  if (job.robot.size() != joints) throw Error(job.source + ": the demo's motion is for 7 joints");
  const detail::Stopwatch watch;
  context.report("simulating", 0.0);
  DemoReport report;
  report.truth = job.robot;
  report.log = record(job.robot, job.seed);
  report.log.source = job.log;

  // From here on nothing is known but the log and the kinematics.
  Robot blind = job.robot;
  blind.set_parameters(Eigen::VectorXd::Zero(10 * joints));
  const Context search = context.part(0.05, 0.1);
  detail::JobProgress progress(search, 0.6);
  IdentifyOptions options;
  options.friction = FrictionLaw::sigmoid;  // eq. (25), as in the letter
  options.progress = std::ref(progress);
  report.identification = identify(blind, {report.log}, {}, options);
  context.report("predicting", 0.1);
  report.predicted = predict_torque(report.identification.robot, report.log, report.identification.cutoff);

  RetrieveJob feasible;
  feasible.model = report.model();
  feasible.source = job.log;
  feasible.bounds = job.bounds;
  feasible.options.runs = 1;  // the letter makes ten; one is enough to see what it is
  feasible.options.seed = job.seed;
  report.retrieval = run(feasible, context.part(0.12, 0.25));
  if (!report.retrieval.succeeded()) throw Error(job.log + ": no feasible parameters were found");

  // The arm as it is from now on; again nothing is known but the logs, and the model made above.
  for (std::size_t k = 0; k < job.runs.size(); ++k) {
    SimulateJob hidden;
    hidden.robot = job.robot;
    hidden.effects = job.effects;
    hidden.seed = job.seed + 1 + k;
    SimulateReport simulated = run(hidden, context.part(0.25, 0.3));
    report.hidden = simulated.run.truth.effects;
    report.runs.push_back(std::move(simulated.run.log));
    report.runs.back().source = job.runs[k];
  }
  DiagnoseJob diagnose;
  diagnose.nominal = report.retrieval.robot;
  diagnose.logs = report.runs;
  report.diagnosis = run(diagnose, context.part(0.3, 1.0));
  report.seconds = watch.seconds();
  context.check();
  return report;
}

ModelFile DemoReport::model() const {
  return {identification.robot, identification.coefficients, "identified from " + log.source};
}

Table DemoReport::torques() const { return detail::torque_table(predicted); }

}  // namespace dynid
