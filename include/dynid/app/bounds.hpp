// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// Bounds for the retrieval of feasible parameters, from what a robot's file says of its links.
struct BoundsJob {
  Robot robot;
  std::string source;     ///< its file, for comments and messages
  bool urdf = false;      ///< the file is a URDF: its collision geometry, if any, is used
  std::string base, tip;  ///< links that the robot was read between, where the URDF branches
  /// The URDF as the bounds file is to name it, relative to its own folder or absolute: centres of mass are
  /// then bound to the convex hulls too. Empty: to boxes alone.
  std::string named;
  double mass_factor = 3.0;  ///< a link's mass is at most so many times more or less than the file's, > 1
  double com_margin = 0.1;   ///< [m] about what is known of a link without collision geometry, > 0
  std::optional<Eigen::Vector2d> total_mass;  ///< lower, upper [kg]; none: the file's sum within a tenth
};

struct BoundsReport {
  std::string robot;               ///< its name
  std::string text;                ///< the bounds file
  Eigen::VectorXd lower, upper;    ///< as Bounds has them
  Eigen::Vector2d total_mass;      ///< lower, upper [kg]
  int with_mass = 0;               ///< links whose mass the file says
  int with_geometry = 0;           ///< links with collision geometry
  std::vector<std::string> notes;  ///< what of the file could not be used, one line each
};

/// Throws OptionError: mass_factor above 1, com_margin above 0, total_mass in order and not negative, and
/// given where a link has no mass.
void check_options(const BoundsJob& job);

/// Allocates. Throws OptionError, Error where the total mass is out of reach of the links'; Stopped.
BoundsReport run(const BoundsJob& job, const Context& context = {});

}  // namespace dynid
