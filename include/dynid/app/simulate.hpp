// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {

/// A closed-loop run of a robot that has chosen effects.
struct SimulateJob {
  Robot robot;                       ///< nominal; effects of a diagnosis in it are simulated
  std::optional<Trajectory> motion;  ///< to follow; none: a random smooth one of that seed within the limits
  double duration = 20.0;            ///< [s] of the random motion
  std::vector<Effect> effects;       ///< hidden; as parse_effects() makes them
  unsigned long seed = 1;            ///< of everything random
  /// Times the torque noise of a good robot; none given: 1, or 0 where `clean`.
  std::optional<double> noise;
  bool clean = false;    ///< perfect encoders, velocities, stamps and packets; the log has ddq
  double rate = 1000.0;  ///< [Hz] of the log; divides 1000
  double spread = 0.0;   ///< relative, of the true parameters around the robot's
};

struct SimulateReport {
  std::string robot;   ///< its name
  std::string motion;  ///< source of the motion
  SimulatedRun run;
  unsigned long seed = 1;
  double noise = 0.0, rate = 0.0, spread = 0.0;
  std::vector<Eigen::VectorXd> effect_rms;  ///< n [N m] each, of run.truth.effects, in their order
  /// Where the centre of mass of a payload is, from the flange and in the last link's frame; empty: none.
  std::string payload;
  Eigen::VectorXd tracking_error;  ///< n [rad or m], the largest
  double seconds = 0.0;
};

/// The effects named by texts `NAME[:key=value,...]`, completed for the robot: see parse_effect(). Throws
/// OptionError of the option `effect`.
std::vector<Effect> parse_effects(const std::vector<std::string>& texts, const Robot& robot);

/// Throws OptionError: `duration` and `rate` positive, `noise` not negative, `spread` 0..0.49. Does not look
/// at the robot.
void check_options(const SimulateJob& job);

/// Allocates. Throws OptionError; Error naming the effect where one of the robot cannot be simulated,
/// and as simulate() and random_motion(); Stopped, once the motion has been simulated.
SimulateReport run(const SimulateJob& job, const Context& context = {});

}  // namespace dynid
