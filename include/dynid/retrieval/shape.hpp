// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "dynid/retrieval/constraint.hpp"

namespace dynid {

/// A convex solid in a link frame [m], for the centre of mass to lie inside. A link of several solids is a
/// union: any_of() of one constraint each.
class Shape {
 public:
  /// Box of half sizes `half` about the origin of `pose`, along its axes. As every factory: throws Error
  /// where a size is not positive or not finite.
  static Shape box(const Eigen::Isometry3d& pose, const Eigen::Vector3d& half);
  /// Box between two corners, along the axes of the link frame.
  static Shape box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper);
  static Shape sphere(const Eigen::Vector3d& centre, double radius);
  /// From the centre of one end to that of the other.
  static Shape cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius);
  /// The same, its radius going from one value to the other; either may be zero.
  static Shape truncated_cone(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_from,
                              double radius_to);
  /// Convex hull of points that do not lie in one plane.
  static Shape hull(const std::vector<Eigen::Vector3d>& points);
  /// Convex hull of the vertices of a mesh file (STL, text or binary, and whatever else assimp reads), scaled
  /// along its axes and placed at `pose`. Throws Error naming the file.
  static Shape mesh(const std::string& path, const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity(),
                    const Eigen::Vector3d& scale = Eigen::Vector3d::Ones());

  /// Convex hull of all the `<collision>` geometry of a URDF that moves with joint `link` (from 1) of the
  /// chain from `base` to `tip` (see parse_urdf(): fixed joints are lumped), in its link frame. Meshes,
  /// boxes, one cylinder or one sphere are exact; among other geometry a cylinder is the prism of 32 sides, a
  /// sphere the polyhedron of 24 meridians and 11 parallels inscribed in it (within 2 % of the radius).
  /// `package://name/...` is looked for in ROS_PACKAGE_PATH, then in the folders above the URDF, one of
  /// which holds `name` or is called so; other names are relative to the URDF. Throws Error naming the file,
  /// where known the line, and the link.
  static Shape collision(const std::string& urdf, int link, const std::string& base = "",
                         const std::string& tip = "");

  /// Clearance of `c` [m]: the smallest distance to a plane side or, radially, to a round one; negative
  /// outside.
  double clearance(const Eigen::Vector3d& c) const;

  /// The centre of mass of link `link` (from 1) lies inside.
  Constraint contains_com(const std::string& name, int link) const;

 private:
  struct Plane {  // normal . c <= offset, outward
    Eigen::Vector3d normal;
    double offset;
  };
  struct Round {  // distance from the line (or point, where axis is zero) at most radius + slope * position
                  // along it
    Eigen::Vector3d point, axis;
    double radius, slope;
  };
  std::vector<Plane> planes_;
  std::vector<Round> rounds_;
};

}  // namespace dynid
