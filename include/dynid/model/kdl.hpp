// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <kdl/chain.hpp>
#include <string>

#include "dynid/model/robot.hpp"

namespace dynid {

/// The robot as a KDL chain, joint by joint: the tip frame of segment k is the frame of link k, and its
/// inertia, rotor inertia (KDL's joint inertia) and viscous friction (KDL's damping) are the robot's. A last,
/// fixed segment holds the tip unless that is the last link itself. Friction beyond the viscous one, limits,
/// gravity and the base's name have no place there. Throws Error where validate() does.
KDL::Chain to_kdl(const Robot& robot);

/// The chain as a robot: fixed joints are lumped, and segments whose joint has no name get `joint1`,
/// `link1`... A link frame is its segment's tip frame, moved without turning to the joint's origin where that
/// tip is off the joint's axis (as in standard DH chains). KDL's joint stiffness, which its solvers leave out
/// too, is passed over.
///
/// `gravity` [m/s^2] in the base frame. Throws Error when there is no moving joint or a joint has a scale
/// other than 1 or -1.
Robot from_kdl(const KDL::Chain& chain, const std::string& name = "robot",
               const std::string& base_link = "base",
               const Eigen::Vector3d& gravity = Eigen::Vector3d(0, 0, -9.81));

}  // namespace dynid
