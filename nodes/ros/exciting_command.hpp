// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <trajectory_msgs/JointTrajectory.h>

#include <Eigen/Core>

#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// A motion that starts where the arm is: from `q` [rad or m] (n) straight, in joint space, to the motion's
/// first sample by a quintic from rest to rest, half a second there, then the motion; time from 0. No joint
/// goes faster on the way than `share` (0..1) of its velocity limit (of 1 rad/s where it has none), nor
/// accelerates harder than that share of its acceleration limit (of 5 rad/s^2). Samples of the approach are
/// 10 ms apart. The way is checked against the position limits only: whoever moves the arm sees that it is
/// free. Throws Error naming the joint: `q` or the motion is beyond the position limits, or the motion is
/// beyond its velocity limits, or does not start and end at rest (0.05 rad/s).
Trajectory with_approach(const Robot& robot, const Eigen::VectorXd& q, const Trajectory& motion,
                         double share);

/// The message for it, to begin when it is received.
trajectory_msgs::JointTrajectory to_message(const Trajectory& motion, const Robot& robot);

/// How far the arm at `q`, `t` seconds after the command, is from where it should be: the least over a start
/// delayed by 0 to 1 s of the largest joint error [rad or m]; `joint` (from 1) is the joint that has it.
double tracking_error(const Trajectory& motion, double t, const Eigen::VectorXd& q, int& joint);

}  // namespace dynid
