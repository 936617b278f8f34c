// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/uncertainty.hpp"

#include <utility>
#include <vector>

#include "app/check.hpp"
#include "dynid/base/error.hpp"
#include "dynid/diagnosis/report.hpp"
#include "dynid/identification/uncertainty.hpp"

namespace dynid {
namespace {

void assume(const std::string& text, Robot& robot, std::vector<Log>& logs) {
  if (text.empty()) return;
  const Assumptions assumed = detail::assumptions(text, robot.size());
  robot = apply_conventions(assumed, robot);
  for (Log& log : logs) log = apply_conventions(assumed, robot, std::move(log));
}

}  // namespace

LearntUncertainty uncertainty_of(const IdentifyJob& job, const IdentifyReport& report) {
  LearntUncertainty out;
  try {
    Robot robot = job.robot, again = job.robot;
    std::vector<Log> logs = job.logs, validation = job.validation;
    const std::string text = job.assume == "auto" ? report.conventions.assume : job.assume;
    assume(text, robot, logs);
    assume(text, again, validation);
    IdentifyOptions options = job.options;
    options.progress = nullptr;
    out.uncertainty = identify_uncertainty(robot, report.identification.robot, logs, validation, options);
  } catch (const Error& error) {
    out.note = error.what();
  }
  return out;
}

LearntUncertainty uncertainty_of(const DiagnoseJob& job, const DiagnoseReport& report) {
  LearntUncertainty out;
  const std::optional<ModelFile> patch = report.patch();
  if (!patch) return out;
  try {
    std::vector<Log> logs = job.logs;
    Robot nominal = report.nominal;
    assume(job.assume == "auto" ? find_conventions(nominal, logs).assume : job.assume, nominal, logs);
    std::vector<HeldOutLog> parts;
    for (Log& log : logs) parts.push_back({patch->robot, std::move(log)});
    out.uncertainty = learn_uncertainty(parts);
  } catch (const Error& error) {
    out.note = error.what();
  }
  return out;
}

}  // namespace dynid
