// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/uncertainty.hpp"

#include <functional>
#include <utility>
#include <vector>

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/app/learn_uncertainty.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

void assume(const std::string& text, Robot& robot, std::vector<Log>& logs, std::vector<Log>& others) {
  if (!text.empty()) detail::read_as_assumed(text, robot, logs, others);
}

}  // namespace

LearntUncertainty uncertainty_of(const IdentifyJob& job, const IdentifyReport& report,
                                 const Context& context) {
  detail::JobProgress progress(context);
  LearntUncertainty out;
  try {
    Robot robot = job.robot;
    std::vector<Log> logs = job.logs, validation = job.validation;
    assume(job.assume == "auto" ? report.conventions.assume : job.assume, robot, logs, validation);
    IdentifyOptions options = job.options;
    options.progress = std::ref(progress);
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
  if (job.logs.size() < 2) {
    out.note = "the patch was fitted to its only log; a second one would show how far its residual strays";
    return out;
  }
  try {
    Robot nominal = job.nominal;
    std::vector<Log> logs = {job.logs.back()}, none;
    assume(job.assume, nominal, logs, none);
    out.uncertainty = learn_uncertainty({{patch->robot, std::move(logs.front())}});
  } catch (const Error& error) {
    out.note = error.what();
  }
  return out;
}

}  // namespace dynid
