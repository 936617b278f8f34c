// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/simulate.hpp"

#include "app/check.hpp"
#include "app/job.hpp"
#include "app/words.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"

namespace dynid {
namespace {

SimulateOptions options_of(const SimulateJob& job, double noise) {
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic(noise);
  if (job.clean) {
    const MeasurementOptions noisy = options.measurement;
    options.measurement = MeasurementOptions::clean();
    options.measurement.white_noise = noisy.white_noise;
    options.measurement.correlated_noise = noisy.correlated_noise;
    options.record_acceleration = true;
  }
  options.seed = job.seed;
  options.spread = job.spread;
  options.rate = job.rate;
  return options;
}

Eigen::VectorXd largest_tracking_error(const SimulatedRun& run, const Trajectory& motion) {
  const Eigen::Index n = run.seen_q.cols();
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(n), q(n), dq(n), ddq(n);
  for (Eigen::Index i = 0; i < run.t.size(); ++i) {
    sample(motion, motion.t[0] + run.t[i], q, dq, ddq);
    largest = largest.cwiseMax((q - run.seen_q.row(i).transpose()).cwiseAbs());
  }
  return largest;
}

}  // namespace

std::vector<Effect> parse_effects(const std::vector<std::string>& texts, const Robot& robot) {
  std::vector<Effect> effects;
  for (const std::string& text : texts) {
    try {
      effects.push_back(parse_effect(text, robot));
    } catch (const Error& error) {
      throw OptionError("effect", text + ": " + error.what());
    }
  }
  return effects;
}

void check_options(const SimulateJob& job) {
  detail::check_positive("duration", job.duration);
  detail::check_positive("rate", job.rate);
  if (job.noise) detail::check_not_negative("noise", *job.noise);
  detail::check_within("spread", job.spread, 0.0, 0.49);
}

SimulateReport run(const SimulateJob& job, const Context& context) {
  check_options(job);
  const Robot& robot = job.robot;
  const detail::Stopwatch watch;
  context.report("simulating", 0.0);
  const Trajectory motion = job.motion ? *job.motion : random_motion(robot, job.duration, job.seed);
  SimulateReport report;
  report.robot = robot.name;
  report.motion = motion.source;
  report.seed = job.seed;
  report.noise = job.noise.value_or(job.clean ? 0.0 : 1.0);
  report.rate = job.rate;
  report.spread = job.spread;
  report.run = simulate(robot, job.effects, motion, options_of(job, report.noise));
  report.seconds = watch.seconds();
  const auto rows = double(report.run.t.size());
  for (const Eigen::MatrixXd& added : report.run.injected)
    report.effect_rms.emplace_back((added.colwise().squaredNorm() / rows).cwiseSqrt().transpose());
  for (const Effect& effect : report.run.truth.effects)
    if (report.payload.empty()) report.payload = detail::payload_place(robot, effect);
  report.tracking_error = largest_tracking_error(report.run, motion);
  context.check();
  return report;
}

}  // namespace dynid
