// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "dynid/app/context.hpp"
#include "dynid/identification/excite.hpp"
#include "dynid/identification/excite_collision.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// A motion worth recording: optimised within every limit.
struct ExciteJob {
  Robot robot;
  CollisionModel collision;           ///< empty: collisions are not checked
  ExciteOptions options;              ///< its `progress` is the context's
  double rate = 1000.0;               ///< [Hz] of the samples
  std::optional<Trajectory> compare;  ///< another motion, to compute the condition number of
};

struct ExciteReport {
  Robot robot;
  Excitation found;
  Trajectory motion;      ///< samples of the motion; none where it does not keep the limits
  std::string collision;  ///< source of the collision model; empty: not checked
  std::string compared;   ///< source of the other motion; empty: none
  double compared_condition_number = 0.0;
  double seconds = 0.0;

  bool succeeded() const noexcept { return found.feasible; }
};

/// Throws OptionError: `harmonics` 1..50, `period`, `rate`, `ramp` and `starts` positive, `base_period` and
/// `threads` not negative, `margin` 0..0.49, `effort` 10..1000000. Does not look at the robot.
void check_options(const ExciteJob& job);

/// Allocates; on options.threads threads. Throws OptionError, Error as excite(), Stopped, once the starts
/// that are under way have ended.
ExciteReport run(const ExciteJob& job, const Context& context = {});

/// The collision model of a robot: read from `choice`; none where that is `none`; where it is empty, that of
/// `NAME_collision.yaml` beside the robot's file `NAME.yaml`, if there is one. Throws Error as
/// read_collision().
CollisionModel collision_model(const std::string& choice, const std::string& robot_file, const Robot& robot);

}  // namespace dynid
