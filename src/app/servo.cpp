// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/servo.hpp"

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

void check_options(const ServoOptions& options) {
  detail::check_positive("substeps", options.substeps);
  detail::check_within("folds", options.folds, 2, 100);
  detail::check_within("confidence", options.confidence, 0.5, 0.999);
}

}  // namespace

LogColumns servo_columns() {
  LogColumns required;
  required.dq = required.tau = false;
  return required;
}

ModelFile IdentifyServosReport::model() const {
  return {identification.robot, {}, "servos identified from " + join(logs, " ")};
}

IdentifyServosReport run(const IdentifyServosJob& job, const Context& context) {
  check_options(job.options);
  const detail::Stopwatch watch;
  detail::JobProgress progress(context);
  ServoOptions options = job.options;
  options.progress = [&progress](const std::string& stage, double fraction) { progress(stage, fraction); };
  IdentifyServosReport report;
  report.identification = identify_servos(job.logs, job.robot, options);
  for (const Log& log : job.logs) report.logs.push_back(log.source);
  report.confidence = options.confidence;
  const std::vector<ServoFit>& joints = report.identification.joints;
  report.error.resize(static_cast<Eigen::Index>(joints.size()));
  report.held_out = report.error;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    report.error[static_cast<Eigen::Index>(j)] = joints[j].error;
    report.held_out[static_cast<Eigen::Index>(j)] = joints[j].held_out;
  }
  report.seconds = watch.seconds();
  context.check();
  return report;
}

ReplayReport run(const ReplayJob& job, const Context& context) {
  context.report("replaying the commands", 0.0);
  ReplayReport report;
  report.replay = replay_servos(job.robot, job.log);
  report.tracking = (job.log.u - job.log.q).cwiseAbs().colwise().mean().transpose();
  context.check();
  return report;
}

Table ReplayReport::table() const {
  const int n = static_cast<int>(replay.q.cols());
  Table table;
  table.names = {"t"};
  for (const char* prefix : {"q", "dq"})
    for (const std::string& name : column_names(prefix, n)) table.names.push_back(name);
  table.values.resize(replay.q.rows(), 1 + 2 * n);
  table.values << replay.t, replay.q, replay.dq;
  return table;
}

}  // namespace dynid
