// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/blind_servos.hpp"

#include <optional>

#include "app/job.hpp"
#include "app/temporary_folder.hpp"
#include "dynid/diagnosis/servo_blind.hpp"

namespace dynid {

BlindReport run_servos(const BlindJob& job, const Context& context) {
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
  report.cases = run_servo_blind(job.nominal, options);
  context.check();
  report.score = score(report.cases);
  report.options = job.options;
  return report;
}

}  // namespace dynid
