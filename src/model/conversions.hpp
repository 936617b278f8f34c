// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "dynid/model/link_inertia.hpp"

namespace dynid::detail {

/// Rz(yaw) Ry(pitch) Rx(roll), `rpy` = (roll, pitch, yaw): URDF's angles.
Eigen::Matrix3d rotation_from_rpy(const Eigen::Vector3d& rpy);

/// Inverse of rotation_from_rpy() to rounding for every rotation, the singular pitch of +-pi/2 included.
Eigen::Vector3d rpy_from_rotation(const Eigen::Matrix3d& R);

/// True where mass, centre of mass and central inertia say the same as `p`, to 1e-15 of its largest entries;
/// false for a link whose mass is too small to carry its first moments.
bool has_centre_of_mass(const StandardParameters& p);

}  // namespace dynid::detail
