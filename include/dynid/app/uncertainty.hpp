// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "dynid/app/context.hpp"
#include "dynid/app/diagnose.hpp"
#include "dynid/app/identify.hpp"
#include "dynid/model/uncertainty.hpp"

namespace dynid {

/// What is written beside a model so that the loop knows how wrong it is; where there is none, the note says
/// why, in one line.
struct LearntUncertainty {
  std::optional<Uncertainty> uncertainty;
  std::string note;
};

/// Of an identified model: identify_uncertainty() on the job's logs, read as the identification read them.
/// Throws Stopped.
LearntUncertainty uncertainty_of(const IdentifyJob& job, const IdentifyReport& report,
                                 const Context& context = {});

/// Of a patched model: learn_uncertainty() on the last log, which only judges the patch; with one log, which
/// the patch was fitted to, there is none and the note says so. Nothing, and no note, where there is no
/// patch.
LearntUncertainty uncertainty_of(const DiagnoseJob& job, const DiagnoseReport& report);

}  // namespace dynid
