// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/retrieval/bounds.hpp"
#include "dynid/retrieval/retrieval.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// Feasible masses, centres of mass and inertias, from the coefficients of a model (eq. (29)) or, in one
/// step, from logs.
struct RetrieveJob {
  ModelFile model;             ///< with its coefficients; with `logs` its kinematics alone count
  std::string source;          ///< what the model was read from, for messages and notes
  std::vector<Log> logs;       ///< one step: |Y pi(p) - tau|^2 with eq. (24) over these; empty: two steps
  Bounds bounds;               ///< a link each
  std::optional<Robot> prior;  ///< known parameters to stay close to among equals
  double cutoff = 0.0;         ///< [Hz] of the filter of `logs`; 0: chosen
  bool weighted = false;       ///< two steps: weight the coefficients by their standard deviations
  RetrievalOptions options;    ///< its `stop` and `progress` are the context's
  /// A stop gives the best of the runs until then (`interrupted` in the report) instead of Stopped.
  bool keep_best_when_stopped = false;
};

struct RetrieveReport {
  RetrievalResult result;
  Robot robot;  ///< with the parameters found and, in one step, friction; as it was where none are feasible
  std::string note;  ///< where the model comes from

  bool succeeded() const noexcept { return result.feasible; }
  ModelFile model() const;  ///< the model to write; no coefficients
};

/// Throws OptionError: `runs` and `steps` must be positive, `threads`, `agree` and `cutoff` must not be
/// negative. Does not look at models, logs and bounds.
void check_options(const RetrieveJob& job);

/// Allocates; on options.threads threads. Throws OptionError; Error naming the source: bounds of another
/// number of links, a coefficient that is missing, or without a standard deviation where `weighted`; Error as
/// identify() and retrieve(); Stopped within a second.
RetrieveReport run(const RetrieveJob& job, const Context& context = {});

}  // namespace dynid
