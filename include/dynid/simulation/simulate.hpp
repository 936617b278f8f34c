// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/trajectory.hpp"
#include "dynid/simulation/computed_torque.hpp"
#include "dynid/simulation/measurement.hpp"

namespace dynid {

struct SimulateOptions {
  MeasurementOptions measurement;    ///< none by default
  unsigned long seed = 1;            ///< of everything random
  double spread = 0.0;               ///< relative, of the true parameters around the nominal: perturbed()
  double rate = 1000.0;              ///< [Hz] of the log; the control rate is a whole multiple of it
  double control_rate = 1000.0;      ///< [Hz]
  double integration_rate = 4000.0;  ///< [Hz] at least
  ControlGains gains;
  bool record_acceleration = false;  ///< the log has the true ddq (and, without jitter, is exact)
  bool record_command = false;       ///< the log has tau_cmd
  bool record_torques = true;        ///< fill `injected` and `model_error`
};

/// A closed-loop run. Matrices are N x n, rows those of the log before any packet was lost.
struct SimulatedRun {
  Log log;            ///< what the robot gives: t, q, dq, tau (ddq, tau_cmd where asked for)
  Robot truth;        ///< the robot that was simulated: true parameters, and all its effects, completed
  Eigen::VectorXd t;  ///< [s] true instants of the rows
  Eigen::MatrixXd q, dq, ddq;  ///< true motion of the links [rad, rad/s, rad/s^2]
  Eigen::MatrixXd tau;         ///< [N m] true joint torque
  /// The motion and the torque as perfect electronics would give them (see Plant::seen_q()).
  Eigen::MatrixXd seen_q, seen_dq, seen_ddq, seen_tau;
  /// [N m] torque that each effect of `truth` adds on the measured side. With model_error, their sum is
  /// seen_tau less the nominal torque at (seen_q, seen_dq, seen_ddq), exactly.
  std::vector<Eigen::MatrixXd> injected;
  Eigen::MatrixXd model_error;  ///< [N m] what the spread of the true parameters makes of it; zero without
};

/// Lets a plant follow a trajectory (from its first sample to its last) under computed torque with the
/// nominal rigid body, rotor inertia and friction. The plant is `nominal`, its parameters spread as asked,
/// with nominal.effects and `effects`. The same for the same seed. Throws Error where Plant does, on a
/// trajectory with another number of joints, on a rate that does not divide the control rate, and when the
/// robot runs away (`joint 2 left its motion at 1.25 s`).
SimulatedRun simulate(const Robot& nominal, const std::vector<Effect>& effects, const Trajectory& trajectory,
                      const SimulateOptions& options = {});

}  // namespace dynid
