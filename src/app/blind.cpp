// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/blind.hpp"

#include <optional>
#include <utility>

#include "app/check.hpp"
#include "app/job.hpp"
#include "app/temporary_folder.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/base/file.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/servo_blind.hpp"

namespace dynid {
namespace {

template <class Bank>
BlindReport run_bank(const BlindJob& job, const Context& context, const Bank& bank) {
  check_options(job);
  detail::JobProgress progress(context);
  BlindOptions options = job.options;
  options.progress = [&progress](int done, int of) {
    progress.tell("case " + std::to_string(done) + " of " + std::to_string(of), double(done) / of);
  };
  options.stop = context.stop;
  std::optional<detail::TemporaryFolder> temporary;
  if (options.folder.empty()) options.folder = temporary.emplace().path();
  BlindReport report;
  report.cases = bank(job.nominal, options);
  context.check();
  report.score = score(report.cases);
  report.options = job.options;
  return report;
}

}  // namespace

void check_options(const BlindJob& job) { detail::check_positive("cases", job.options.cases); }

BlindReport run(const BlindJob& job, const Context& context) {
  return run_bank(job, context,
                  [](const Robot& robot, const BlindOptions& options) { return run_blind(robot, options); });
}

BlindReport run_servos(const BlindJob& job, const Context& context) {
  return run_bank(job, context, [](const Robot& robot, const BlindOptions& options) {
    return run_servo_blind(robot, options);
  });
}

std::string BlindReport::calibration(const std::vector<std::string>& earlier) const {
  std::vector<BlindCase> all = cases;
  std::string with;
  for (const std::string& path : earlier) {
    for (BlindCase& c : blind_cases(read_file(path), path)) all.push_back(std::move(c));
    with += " --with " + path;
  }
  return calibration_yaml(fit_calibration(all), "dynid blind --cases " + std::to_string(options.cases) +
                                                    " --seed " + std::to_string(options.seed) + " --kind " +
                                                    word_for(blind_kinds(), options.kind) +
                                                    (options.given_robot ? " --motions"
                                                     : options.family    ? " --family"
                                                                         : "") +
                                                    with + " --calibrate FILE");
}

}  // namespace dynid
