// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// All points within `radius` [m] of a segment fixed to a link.
struct Capsule {
  std::string link;          ///< its name
  int frame = 0;             ///< 0 the base, i the link of joint i, n + 1 the tip
  Eigen::Vector3d from, to;  ///< [m] in the link frame; a sphere where they are one
  double radius = 0.0;       ///< [m]
};

/// A box that stands still.
struct BoxObstacle {
  std::string name;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();          ///< [m] in the base frame
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< of its axes, in the base frame
  Eigen::Vector3d size = Eigen::Vector3d::Ones();            ///< [m] lengths of its edges
};

/// What a robot must stay clear of: itself, the floor, boxes.
struct CollisionModel {
  std::string source;           ///< file, for messages
  double clearance = 0.0;       ///< [m] to be kept between any two
  std::optional<double> floor;  ///< [m] its height, along -gravity, in the base frame
  std::vector<Capsule> capsules;
  std::vector<BoxObstacle> boxes;
  /// Names (links, boxes, `floor`) that may touch; a link and its neighbours always may.
  std::vector<std::pair<std::string, std::string>> ignore;
};

/// Reads `format: dynid-collision-1`. Throws Error naming file, line and key. The keys:
/// - `clearance` [m], >= 0; `floor` [m], the height of a horizontal floor in the base frame, seen along
///   gravity: both may be left out.
/// - `capsules`: a list of `{link, from: [x, y, z], to: [x, y, z], radius}`, in the frame of the link (the
///   robot's base and tip links have names too).
/// - `boxes`: a list of `{name, xyz, rpy, size: [x, y, z]}` in the base frame; xyz is the centre, rpy
///   (Rz(yaw) Ry(pitch) Rx(roll)) may be left out; may be left out.
/// - `ignore`: a list of pairs of names that may touch; may be left out.
CollisionModel read_collision(const std::string& path, const Robot& robot);

/// The same from a text; `name` stands for the file in what an Error says.
CollisionModel parse_collision(const std::string& text, const std::string& name, const Robot& robot);

}  // namespace dynid
