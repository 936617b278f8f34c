// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <urdf_model/model.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "dynid/model/link_inertia.hpp"
#include "xml_index.hpp"

namespace dynid::detail {

/// A link of the file and its pose in the frame of the moving link that it is part of.
struct UrdfBody {
  urdf::LinkConstSharedPtr link;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

/// One moving joint of the chain, its link, and what is lumped into it.
struct UrdfJoint {
  urdf::JointConstSharedPtr joint;
  urdf::LinkConstSharedPtr link;
  Eigen::Isometry3d origin =
      Eigen::Isometry3d::Identity();  ///< in the link frame of the moving joint before it
  StandardParameters lumped = StandardParameters::Zero();  ///< of the other bodies that move with the link
  std::vector<UrdfBody> bodies;                            ///< all that move with the link, itself first
};

/// The way from base to tip through a URDF.
struct UrdfChain {
  std::string robot_name, base, tip;
  std::vector<UrdfJoint> joints;
  Eigen::Isometry3d tip_pose = Eigen::Isometry3d::Identity();   ///< in the last moving link's frame
  Eigen::Isometry3d base_pose = Eigen::Isometry3d::Identity();  ///< in the root's frame, joints at zero
  std::vector<XmlElement> elements;                             ///< of the text
};

/// Reads `text` with urdfdom and finds the chain; see parse_urdf() for the rules and the errors. Without
/// `collision` no word about collision geometry is read, right or wrong.
UrdfChain read_chain(const std::string& text, const std::string& name, const std::string& base,
                     const std::string& tip, bool collision = false);

Eigen::Isometry3d to_eigen(const urdf::Pose& pose);

/// A link's own inertial, in its frame; zero when there is none.
StandardParameters own_parameters(const urdf::Link& link);

/// The direct child of the root called `tag` (link, joint) whose name is `name`, or null.
const XmlElement* find_named(const std::vector<XmlElement>& elements, const char* tag,
                             const std::string& name);

}  // namespace dynid::detail
