// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/pipeline.hpp"

namespace dynid {
namespace {

// Of a log of half a minute, by the clock.
constexpr double share_of_identify = 0.15, share_of_retrieve = 0.45;

}  // namespace

void check_options(const PipelineJob& job) {
  check_options(job.identify);
  if (job.retrieve) check_options(*job.retrieve);
  if (job.diagnose) check_options(*job.diagnose);
}

PipelineReport run(const PipelineJob& job, const Context& context) {
  check_options(job);
  PipelineReport report;
  double from = 0.0;
  const auto next = [&](double share, bool last) {
    const double to = last ? 1.0 : from + share;
    Context part = context.part(from, to);
    from = to;
    return part;
  };

  IdentifyJob identify = job.identify;
  identify.robot = job.robot;
  identify.source = job.source;
  identify.logs = {job.log};
  report.identify = run(identify, next(share_of_identify, !job.retrieve && !job.diagnose));
  if (job.identified) job.identified(report.identify);

  if (job.retrieve) {
    RetrieveJob retrieve = *job.retrieve;
    retrieve.model = report.identify.model();
    if (retrieve.source.empty()) retrieve.source = "the coefficients identified from " + job.log.source;
    retrieve.logs.clear();
    report.retrieve = run(retrieve, next(share_of_retrieve, !job.diagnose));
    if (job.retrieved) job.retrieved(*report.retrieve);
  }
  if (job.diagnose) {
    DiagnoseJob diagnose = *job.diagnose;
    diagnose.nominal = job.robot;
    diagnose.logs = {job.log};
    report.diagnose = run(diagnose, next(1.0, true));
    if (job.diagnosed) job.diagnosed(*report.diagnose);
  }
  return report;
}

bool PipelineReport::succeeded() const {
  return (!retrieve || retrieve->succeeded()) && (!diagnose || diagnose->succeeded());
}

}  // namespace dynid
