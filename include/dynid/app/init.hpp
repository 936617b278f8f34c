// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// Which frame a row of a Denavit-Hartenberg table leads to.
enum class DhConvention {
  modified,  ///< Khalil, Craig: Rx(alpha) Tx(a) Rz(theta + q) Tz(d), as a model file has it
  standard,  ///< Denavit, Spong: Rz(theta + q) Tz(d) Tx(a) Rx(alpha)
};

/// A first model file of a robot of which there is a Denavit-Hartenberg table and no more.
struct InitJob {
  Table dh;              ///< columns a [m], alpha [rad], d [m] and theta [rad] (left out: 0), a row a joint
  bool degrees = false;  ///< alpha and theta are in degrees
  std::string types;     ///< a letter a joint, R turns, P slides, C turns without limits; empty: all turn
  std::vector<std::string> joint_names;  ///< empty: joint1, joint2, ...
  std::string name = "robot";
  DhConvention convention = DhConvention::modified;
  Eigen::Vector3d gravity = Eigen::Vector3d(0, 0, -9.81);  ///< [m/s^2] in the base frame
};

struct InitReport {
  Robot robot;       ///< what the text says: kinematics and gravity alone
  std::string text;  ///< a model file with comments, whose examples of what is not known yet are comments too
};

/// Throws OptionError: one letter of R, P, C and one name for each row; names are of letters, digits,
/// underscores, hyphens and points, no two are alike; gravity is finite.
void check_options(const InitJob& job);

/// Allocates. Throws OptionError, Error naming the table for a column that is missing or has no meaning;
/// Stopped.
InitReport run(const InitJob& job, const Context& context = {});

}  // namespace dynid
