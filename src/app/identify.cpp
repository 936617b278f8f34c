// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/identify.hpp"

#include "app/check.hpp"
#include "app/job.hpp"

namespace dynid {

void check_options(const IdentifyJob& job) {
  detail::check_not_negative("cutoff", job.options.prepare.cutoff);
  detail::check_not_negative("prune", job.options.prune_percent);
}

IdentifyReport run(const IdentifyJob& job, const Context& context) {
  check_options(job);
  const detail::Stopwatch watch;
  detail::JobProgress progress(context, 0.6);
  IdentifyOptions options = job.options;
  options.progress = std::ref(progress);
  IdentifyReport report;
  Robot robot = job.robot;
  std::vector<Log> logs = job.logs, validation = job.validation;
  const detail::AssumedReading reading = detail::read_as_assumed(job.assume, robot, logs, validation);
  report.conventions = reading.conventions;
  report.conventions_applied = reading.applied;
  report.identification = identify(robot, logs, validation, options);
  report.source = job.source;
  for (const Log& log : job.logs) report.logs.push_back(log.source);
  report.physically_consistent = inconsistencies(report.identification.robot).empty();
  report.seconds = watch.seconds();
  context.check();
  return report;
}

ModelFile IdentifyReport::model() const {
  std::string note = "identified from";
  for (const std::string& log : logs) note += " " + log;
  return {identification.robot, identification.coefficients, note};
}

}  // namespace dynid
