// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/diagnosis/gap_motion.hpp"

namespace dynid::detail {

/// A link that a spring, with play or without, holds to its motor, whose motion is the one measured.
struct SpringInJoint {
  double stiffness;      ///< [N m/rad]
  double gap;            ///< [rad] without torque, from end to end
  double damping_ratio;  ///< of the link on the spring, its motor held
};

/// What `joint` (from 0) of the measured motion has more of torque for it, in every joint: N x n [N m]. The
/// link is simulated on a path of its own, driven by gravity, its neighbours and its friction.
Eigen::MatrixXd spring_torque(const GapMotion& motion, int joint, const SpringInJoint& spring);

}  // namespace dynid::detail
