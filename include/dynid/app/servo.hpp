// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// Position servos from commanded and measured positions.
struct IdentifyServosJob {
  std::optional<Robot> robot;  ///< a rigid body with known inertia; none: each joint stands alone
  std::vector<Log> logs;       ///< with t, u, q
  ServoOptions options;        ///< its `progress` is replaced by the context's
};

struct IdentifyServosReport {
  ServoIdentification identification;
  std::vector<std::string> logs;    ///< their sources
  double confidence = 0.0;          ///< of the intervals
  Eigen::VectorXd error, held_out;  ///< n [rad or m]: mean absolute, open loop; on what was left out in turns
  double seconds = 0.0;

  ModelFile model() const;  ///< as a file carries it
};

/// The motion that a model with servos makes of a log's commands, open loop from its first state.
struct ReplayJob {
  Robot robot;
  Log log;  ///< with t, u, q
};

struct ReplayReport {
  ServoReplay replay;
  Eigen::VectorXd tracking;  ///< n [rad or m]: mean absolute difference of command and position

  Table table() const;  ///< t, q1.., dq1..
};

/// What a log must have for both: t, u and q.
LogColumns servo_columns();

/// Allocates. Throws OptionError of the options `substeps`, `folds` and `confidence`; Error as
/// identify_servos(); Stopped.
IdentifyServosReport run(const IdentifyServosJob& job, const Context& context = {});
/// Allocates. Throws Error as replay_servos(); Stopped.
ReplayReport run(const ReplayJob& job, const Context& context = {});

}  // namespace dynid
