// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

namespace dynid {

/// The smallest box [m], along the axes of the link frame, around all the `<collision>` geometry of a URDF
/// that moves with joint `link` (from 1) of the chain from `base` to `tip`; none where there is no geometry.
/// Exact for boxes, cylinders, spheres and meshes. Meshes are found, and Errors thrown, as
/// Shape::collision() does it.
std::optional<Eigen::AlignedBox3d> collision_box(const std::string& urdf, int link,
                                                 const std::string& base = "", const std::string& tip = "");

}  // namespace dynid
