// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <trajectory_msgs/JointTrajectory.h>

#include <Eigen/Core>

#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// The motion that a command asks of an arm at rest at `held` [rad or m] (n), joints matched by name and
/// brought into the robot's order, time from 0. Velocities that are left out are the slopes of the parabola
/// through three neighbouring points, accelerations the same of the velocities, both zero at either end; in
/// between sample() goes by the quintic of both neighbours. Where the first point has
/// time_from_start > 0, the motion begins at `held`, at rest.
///
/// Throws Error, in one line that names the joint, for: no points; a joint that is not the robot's, missing
/// or named twice; points of other sizes, not finite, or not in the order of time; a first point at time 0
/// that is farther than `tolerance` [rad or m] from `held`; a start or an end that is not at rest (0.05
/// rad/s); and a position, velocity or acceleration beyond the joint's limits at any millisecond on the way.
Trajectory motion_from(const trajectory_msgs::JointTrajectory& command, const Robot& robot,
                       const Eigen::VectorXd& held, double tolerance);

}  // namespace dynid
