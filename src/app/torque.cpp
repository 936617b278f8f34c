// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/torque.hpp"

#include "app/check.hpp"
#include "app/torque_table.hpp"
#include "dynid/base/error.hpp"
#include "dynid/diagnosis/effect_prediction.hpp"

namespace dynid {

namespace detail {

Table torque_table(const PredictedTorque& predicted) {
  const int n = static_cast<int>(predicted.tau.cols());
  Table table;
  table.names = {"t"};
  for (const char* prefix : {"tau", "tauf"})
    for (const std::string& name : column_names(prefix, n)) table.names.push_back(name);
  table.values.resize(predicted.tau.rows(), 1 + 2 * n);
  table.values << predicted.t, predicted.tau, predicted.tau_f;
  return table;
}

}  // namespace detail

LogColumns torque_columns() {
  LogColumns required;
  required.t = required.dq = required.tau = false;
  return required;
}

void check_options(const TorqueJob& job) { detail::check_not_negative("cutoff", job.cutoff); }

TorqueReport run(const TorqueJob& job, const Context& context) {
  check_options(job);
  const Log& log = job.log;
  if (log.ddq.size() == 0 && log.t.size() == 0)
    throw Error(log.source + ": column t is missing (it is needed where there is no ddq1..ddq" +
                std::to_string(job.robot.size()) + ")");
  context.report("predicting", 0.0);
  TorqueReport report;
  report.robot = job.robot.name;
  report.predicted = predict_torque(job.robot, log, job.cutoff);
  context.report("predicting the effects", 0.5);
  report.predicted.tau += predict_effects(job.robot, log, job.cutoff);
  if (log.tau.size() > 0)
    report.rms_difference = ((report.predicted.tau - log.tau).colwise().squaredNorm() / double(log.samples()))
                                .cwiseSqrt()
                                .transpose();
  context.check();
  return report;
}

Table TorqueReport::table() const { return detail::torque_table(predicted); }

}  // namespace dynid
