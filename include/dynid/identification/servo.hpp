// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynid/dynamics/servo_joint.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

/// Settings of identify_servos(); each default with its reason.
struct ServoOptions {
  /// Steps of the open-loop simulation for each sampling interval. Four keep the discretisation below a
  /// hundredth of the motion error of a servo whose natural frequency is a tenth of the sampling rate's; the
  /// final fit takes four times as many.
  int substeps = 4;
  /// Longest delay sought, in sampling intervals: longer ones are outer-loop effects, not a servo's.
  int longest_delay = 10;
  /// Least fraction by which a further term must lower the mean absolute error on the data left out. Two per
  /// cent is the spread of that error over the folds when nothing is missing.
  double least_gain = 0.02;
  /// Parts of the logs (or, where there are fewer logs, of their time) of which one at a time is left out.
  int folds = 3;
  bool further_terms = true;  ///< seek terms beyond stiffness, damping, Coulomb friction, delay and bias
  /// Of the intervals. Where the model is the robot's, these hold the truth so often; where logs ask for
  /// other numbers each (three at least), they hold what as many other logs give.
  double confidence = 0.9;
  /// Called with the stage and the share done, on any thread but never on two at once; may throw to cancel.
  std::function<void(const std::string& stage, double fraction)> progress;
};

/// One identified number.
struct ServoValue {
  std::string name;  ///< as in the `servo:` of a model file, or coulomb, rotor_inertia
  std::string unit;
  double value = 0.0, low = 0.0, high = 0.0;  ///< interval at ServoOptions::confidence
};

/// Two numbers that the logs do not tell apart.
struct ServoAlias {
  std::string first, second;
  double correlation = 0.0;  ///< of their estimates; 0: the same term of the equation of motion
};

/// A term tried, and the error on data left out without it and with it [rad].
struct ServoTerm {
  std::string name;
  double without = 0.0, with = 0.0;
  bool kept = false;
};

/// What was found for one joint.
struct ServoFit {
  int joint = 0;            ///< from 1
  std::string name;         ///< of the joint
  bool identified = false;  ///< false: its command never moves
  bool si = false;          ///< kp is known in N m/rad; else only ratios to it are claimed
  ServoJoint ratios;
  std::vector<ServoValue> values;
  std::vector<ServoAlias> aliases;
  std::vector<ServoTerm> terms;
  double error = 0.0;     ///< mean absolute open-loop position error on the logs fitted [rad]
  double held_out = 0.0;  ///< the same on parts left out of the fit, one after another [rad]
  std::vector<std::string> remarks;
};

struct ServoIdentification {
  Robot robot;  ///< the one given, or joints that stand alone; each identified joint with its servo
  std::vector<ServoFit> joints;
  std::vector<DataIssue> issues;
};

/// Identifies the position servos of an arm from commanded and measured positions.
///
/// Joint by joint, with every torque over kp:
///   a ddq + c dq + f sgn dq + L = clip(u(t - d) - q),
/// see ServoJoint. First, for each delay on a grid, the equation error is solved in closed form on a
/// triangular factor; from there, and from two plain starts, the open-loop motion from each log's first state
/// is fitted to the measured one (output error) by Levenberg-Marquardt with the analytic sensitivities of
/// ServoState. The loss is Huber's, so that the few moments at which a stuck joint breaks away early or late
/// do not govern the rest. Further terms (Stribeck friction, load friction, torque limit, command filter, and
/// the rigid body where a robot is given) are added one at a time, each only if it lowers the error on parts
/// of the logs that were left out.
///
/// logs: with t [s], u and q [rad or m], N x n each; dq is not needed. robot: a rigid body with known
/// inertia, or none. With it, gravity, inertia and the coupling between joints, evaluated along the measured
/// motion, enter multiplied with 1 / kp; where that holds on data left out, kp is in N m/rad, and the rest
/// follows in SI. Otherwise only ratios are claimed.
///
/// Intervals: sandwich covariance of the scores of blocks of time; of three logs or more scaled up to how the
/// parameters move when one of them is left out, where that is more.
///
/// Throws Error naming log and joint: no u, sizes that differ, commands or positions in degrees, no joint
/// whose command moves, too short. Allocates about (10 + 2 n) times the logs. Runs on oneTBB; the result does
/// not depend on the number of threads.
ServoIdentification identify_servos(const std::vector<Log>& logs, const std::optional<Robot>& robot = {},
                                    const ServoOptions& options = {});

/// The motion that a model with servos makes of a log's commands.
struct ServoReplay {
  Eigen::VectorXd t;      ///< [s] N, the log's stamps
  Eigen::MatrixXd q, dq;  ///< [rad, rad/s] N x n
  Eigen::VectorXd error;  ///< mean absolute difference to the log's q [rad] n
};

/// Open loop from the log's first position (at rest, or at its first dq): nothing else of the measured motion
/// is used. Joints whose kp is known are coupled through the rigid body (mass matrix, Coriolis and gravity
/// torques at the simulated state; the velocities of a step, with friction, by projected Gauss-Seidel);
/// joints with ratios only stand alone. Throws Error: a joint without servo, no u, sizes that differ.
ServoReplay replay_servos(const Robot& robot, const Log& log, int substeps = 16);

}  // namespace dynid
