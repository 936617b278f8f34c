// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/identification/conventions.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// Dynamic coefficients and friction from recorded motions: dynid::identify() as a use case.
struct IdentifyJob {
  Robot robot;
  std::string source;           ///< what the robot was read from, for messages
  std::vector<Log> logs;        ///< fitted; each has the robot's joints, base to tip
  std::vector<Log> validation;  ///< predicted, never fitted
  /// How the logs are to be read: empty: as they stand; `auto`: as find_conventions() says; else a text for
  /// parse_assumptions().
  std::string assume;
  IdentifyOptions options;  ///< its `progress` is not called: the context's is
};

struct IdentifyReport {
  Identification identification;
  std::string source;             ///< of the robot
  std::vector<std::string> logs;  ///< sources of the logs that were fitted
  /// In which the logs differ from what the robot's inertials say: applied, where that was assumed.
  ConventionReport conventions;
  bool conventions_applied = false;
  bool physically_consistent = false;  ///< the robot nearest the given one that has the coefficients
  double seconds = 0.0;

  /// The model to write: robot, coefficients and, as its note, where it comes from.
  ModelFile model() const;
};

/// Throws OptionError: `cutoff` and `prune` must not be negative (0: chosen, none). Does not look at robot
/// and logs.
void check_options(const IdentifyJob& job);

/// Allocates; on the calling thread and its helpers. Throws OptionError, Error as identify(), Stopped.
IdentifyReport run(const IdentifyJob& job, const Context& context = {});

}  // namespace dynid
