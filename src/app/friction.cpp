// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/friction.hpp"

#include "app/check.hpp"
#include "app/job.hpp"

namespace dynid {

void check_options(const FrictionJob& job) {
  detail::check_not_negative("cutoff", job.options.prepare.cutoff);
  detail::check_not_negative("prune", job.options.prune_percent);
}

FrictionReport run(const FrictionJob& job, const Context& context) {
  check_options(job);
  const detail::Stopwatch watch;
  detail::JobProgress progress(context, 0.6);
  IdentifyOptions options = job.options;
  options.progress = std::ref(progress);
  FrictionReport report;
  Robot robot = job.robot;
  std::vector<Log> logs = job.logs, none;
  const detail::AssumedReading reading = detail::read_as_assumed(job.assume, robot, logs, none);
  report.conventions = reading.conventions;
  report.conventions_applied = reading.applied;
  report.friction = identify_friction(robot, logs, job.options.friction, options);
  report.law = job.options.friction;
  report.source = job.source;
  report.seconds = watch.seconds();
  context.check();
  return report;
}

ModelFile FrictionReport::model() const {
  return {friction.robot, {}, "friction identified on top of " + source};
}

}  // namespace dynid
