// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace dynid::detail {

/// Planes (outward unit normal n, offset d: n . x <= d) of the convex hull of `points`. Throws Error where
/// they lie in one plane.
std::vector<std::pair<Eigen::Vector3d, double>> hull_planes(const std::vector<Eigen::Vector3d>& points);

/// All vertices of the mesh, nodes' transforms applied. Throws Error naming the file.
std::vector<Eigen::Vector3d> mesh_vertices(const std::string& path);

}  // namespace dynid::detail
