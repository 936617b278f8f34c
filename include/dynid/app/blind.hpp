// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/diagnosis/blind.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// The check of the diagnosis: a bank of simulated robots whose effects are withheld from it.
struct BlindJob {
  Robot nominal;
  BlindOptions options;  ///< its `progress` is the context's; with an empty `folder` nothing is kept
};

struct BlindReport {
  std::vector<BlindCase> cases;
  BlindScore score;
  BlindOptions options;  ///< of the bank

  /// What makes probabilities and intervals mean what they say, fitted to this bank and to those of
  /// `earlier`: files that dynid blind --json wrote, with the calibration that is in use. Text of a
  /// calibration file. Throws Error as fit_calibration() and blind_cases().
  std::string calibration(const std::vector<std::string>& earlier = {}) const;
};

/// What a calibration needs of the cases of an earlier bank: truth, findings and what was weighed. `text`:
/// what dynid blind --json wrote; `source`: its file. Throws Error naming the source, and the case, where it
/// is anything else.
std::vector<BlindCase> blind_cases(const std::string& text, const std::string& source);

/// Throws OptionError: `cases` must be positive.
void check_options(const BlindJob& job);

/// Allocates; on all cores. Throws OptionError, Error as run_blind(), Stopped once the cases under way have
/// ended.
BlindReport run(const BlindJob& job, const Context& context = {});
/// The same on servo logs: run_servo_blind().
BlindReport run_servos(const BlindJob& job, const Context& context = {});

}  // namespace dynid
