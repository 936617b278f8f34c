// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "dynid/model/link_inertia.hpp"
#include "dynid/model/robot.hpp"

namespace dynid::detail::exporting {

// What the exports share: numbers and attributes as text, names, and what no simulator's file has a word for.

/// What is written is read again as the same double.
std::string number(double x);
/// `x y z`; -0 becomes 0.
std::string triple(const Eigen::Vector3d& v);
/// ` key="value"`, escaped.
std::string attribute(const char* key, const std::string& value);

bool bounded(const JointLimits& limits);
/// A position limit as simulators write, and take, one that there is not.
std::string position_limit(double value);

/// Throws Error where two joints or two links share a name, or a link that moves is called `world`.
void check_names(const Robot& robot);
/// The tip's name where the tip is more than the last link itself, else empty.
std::string tip_name(const Robot& robot);

/// What no simulator's file has a word for.
void list_joint_not_expressed(const Joint& joint, std::vector<std::string>& list);
void list_first_moments_not_expressed(const StandardParameters& p, const std::string& link,
                                      std::vector<std::string>& list);

/// Central inertia along its principal axes, moments ascending.
struct PrincipalInertia {
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  ///< at the centre of mass, in the link frame
  Eigen::Vector3d moments;
};
PrincipalInertia principal_inertia(const LinkInertia& body);

/// Eqs. (11) and (16) as the simulators check them; `least`: the least mass and moment that they take.
void list_impossible(const LinkInertia& body, const std::string& link, double least,
                     const std::string& program, std::vector<std::string>& list);

}  // namespace dynid::detail::exporting
