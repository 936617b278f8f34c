// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"
#include "dynid/simulation/servo_plant.hpp"

namespace dynid {

/// A run of an arm with position servos that has chosen effects: simulate_servos().
struct SimulateServosJob {
  Robot robot;                         ///< nominal; every joint has a servo
  std::optional<Trajectory> commands;  ///< positions to command; none: a random smooth motion of that seed
  double duration = 20.0;              ///< [s] of the random motion
  std::vector<Effect> effects;         ///< hidden; as parse_servo_effects() makes them
  unsigned long seed = 1;              ///< of everything random
  std::optional<double> noise;         ///< times the position noise of a good servo; none: 1
  bool clean = false;                  ///< no encoder steps and no noise
  double rate = 100.0;                 ///< [Hz] of commands and log
  double spread = 0.0;                 ///< relative, of the true parameters around the robot's
  bool torque = false;                 ///< the log has tau too
};

struct SimulateServosReport {
  std::string robot, commands;  ///< name; source
  ServoRun run;
  unsigned long seed = 1;
  double noise = 0.0, rate = 0.0, spread = 0.0;
  Eigen::VectorXd tracking_error;  ///< n [rad or m], mean of |u - q|
  double seconds = 0.0;
};

/// The effects named by texts `NAME[:key=value,...]` in the words of both catalogues. Where the width over
/// which a dry friction changes its sign is not given it is the sharpest that a plant takes: a joint that
/// holds a position does not creep. Throws OptionError of the option `effect`.
std::vector<Effect> parse_servo_effects(const std::vector<std::string>& texts, const Robot& robot);

/// Throws OptionError: `duration` and `rate` positive, `noise` not negative, `spread` 0..0.49.
void check_options(const SimulateServosJob& job);

/// Allocates. Throws OptionError; Error as simulate_servos() and random_motion(); Stopped once it has been
/// simulated.
SimulateServosReport run(const SimulateServosJob& job, const Context& context = {});

nlohmann::json labels_json(const SimulateServosReport& report);  ///< the effects: name, joints, parameters
nlohmann::json to_json(const SimulateServosReport& report);
void print(std::ostream& out, const SimulateServosReport& report, const std::string& written_to);

}  // namespace dynid
