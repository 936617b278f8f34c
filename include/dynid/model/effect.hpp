// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

namespace dynid {

/// Something that a robot does beyond the rigid body and its friction laws, by a name of the catalogue
/// (joint_spring, time_delay, ...): plain data, as a model file carries it.
///
/// What the parameters mean is said where they are used (simulation/ makes effects, diagnosis/ finds them).
/// A parameter that every joint has of its own is one number for each of the robot's n joints, base to tip,
/// zero where the joint has none of it; one of the whole arm has the size that its meaning asks for. SI
/// units.
struct Effect {
  std::string name;
  std::vector<int> joints;  ///< that it acts on, from 1, increasing
  std::map<std::string, std::vector<double>> parameters;
};

}  // namespace dynid
