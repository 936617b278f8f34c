// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "dynid/app/context.hpp"
#include "dynid/app/diagnose.hpp"
#include "dynid/app/identify.hpp"
#include "dynid/app/retrieve.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// What one log says of a robot: identified, made feasible, and compared with the model in use.
struct PipelineJob {
  Robot robot;         ///< the model in use
  std::string source;  ///< what it was read from, for messages
  Log log;
  /// Options and what else there is of each step; robot, model and logs are filled in.
  IdentifyJob identify;
  std::optional<RetrieveJob> retrieve;  ///< with bounds; none: not asked for
  std::optional<DiagnoseJob> diagnose;  ///< none: not asked for

  /// Called as each step ends, on the calling thread, for its files to be written whatever becomes of the
  /// next steps. What they throw ends the job.
  std::function<void(const IdentifyReport&)> identified;
  std::function<void(const RetrieveReport&)> retrieved;
  std::function<void(const DiagnoseReport&)> diagnosed;
};

struct PipelineReport {
  IdentifyReport identify;
  std::optional<RetrieveReport> retrieve;
  std::optional<DiagnoseReport> diagnose;

  /// Something feasible was found, where it was asked for, and the data were fit to be diagnosed.
  bool succeeded() const;
};

/// check_options() of each step.
void check_options(const PipelineJob& job);

/// Allocates; on all cores. Throws as the steps do.
PipelineReport run(const PipelineJob& job, const Context& context = {});

}  // namespace dynid
