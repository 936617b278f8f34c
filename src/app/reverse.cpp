// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/reverse.hpp"

#include "app/check.hpp"
#include "app/job.hpp"

namespace dynid {

void check_options(const ReverseJob& job) { detail::check_not_negative("prune", job.options.prune_percent); }

ReverseReport run(const ReverseJob& job, const Context& context) {
  check_options(job);
  context.report("fitting", 0.0);
  const detail::Stopwatch watch;
  ReverseReport report;
  report.identification = reverse_engineer(job.robot, job.samples, job.options);
  report.source = job.source;
  report.samples = job.samples.source;
  report.physically_consistent = inconsistencies(report.identification.robot).empty();
  report.seconds = watch.seconds();
  context.check();
  return report;
}

ModelFile ReverseReport::model() const {
  return {identification.robot, identification.coefficients, "reverse engineered from " + samples};
}

}  // namespace dynid
