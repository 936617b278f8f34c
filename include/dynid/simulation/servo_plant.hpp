// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

struct SimulateServosOptions {
  double rate = 100.0;     ///< [Hz] of commands and log
  unsigned long seed = 1;  ///< of everything random
  double spread = 0.0;     ///< relative, of the true parameters around the nominal: perturbed_servos()
  /// [Hz] of the servo's own loop, at least: that of a digital servo, far above any joint's frequency.
  double servo_rate = 4000.0;
  /// [rad] step of the encoder that the log is read from; of a prismatic joint this part of its travel
  /// (JointScale) for 2 pi. 0: none. The default is 14 bits a turn.
  double encoder_step = 3.835e-4;
  double noise = 0.2;          ///< standard deviation before the encoder's steps, in steps
  double settle = 1.0;         ///< [s] at the first command, before the log begins
  bool record_torque = false;  ///< the log has tau: what servo and damping give
  /// Adds to `torque` [N m] (n) at time `t` [s] of the log and the true state: what no catalogue has. May be
  /// null.
  std::function<void(double t, const Eigen::VectorXd& q, const Eigen::VectorXd& dq, Eigen::VectorXd& torque)>
      disturbance;
};

/// A run of an arm that follows commanded positions. Matrices are N x n.
struct ServoRun {
  Log log;                     ///< t, u, q, dq (tau where asked for)
  Robot truth;                 ///< what was simulated: true parameters, the servos with their effects
  std::vector<Effect> hidden;  ///< effects put in, completed
  Eigen::MatrixXd q, dq, tau;  ///< true [rad, rad/s, N m]
};

/// perturbed(), and stiffness and damping of the servos scaled each by 1 + spread times a normal number.
Robot perturbed_servos(const Robot& robot, double spread, unsigned long seed);

/// SimulateServosOptions::encoder_step of each joint [rad or m].
Eigen::VectorXd encoder_steps(const Robot& robot, double step);

/// Lets servos follow the positions of a trajectory, each command held from its row to the next, `rate` times
/// a second.
///
/// The arm is a Plant (rigid body, friction that resists inside the integration, effects in the plant's own
/// laws), the servos are digital: at each instant of their loop they give
///   tau = clip(kp gap(u_f - q - bias), limit) + part g(q),
/// u_f the command of `delay` ago behind a first-order filter, gap() a dead zone of the width of `backlash`,
/// and hold it until the next. Damping kd, load friction and Stribeck friction act in the plant. The
/// parameters of a joint with a servo of known ratios only are over kp, and stand alone; a robot has either
/// kind.
///
/// robot: every joint has a servo; its own effects are simulated too. effects: further, as
/// parse_servo_effect() makes them. The same for the same seed. Throws Error: no servo, another number of
/// joints, both kinds of servos, options out of range, as Plant, and when a joint leaves its commands.
ServoRun simulate_servos(const Robot& robot, const std::vector<Effect>& effects, const Trajectory& commands,
                         const SimulateServosOptions& options = {});

}  // namespace dynid
