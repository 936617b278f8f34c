// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynid/diagnosis/blind.hpp"
#include "dynid/simulation/family.hpp"

namespace dynid::detail {

/// What the robot is given in one case.
struct Draw {
  std::vector<Effect> effects;  // known to the plant
  std::string unknown;          // or made by torque_of_unknown()
  std::vector<std::string> withheld;
  std::vector<int> unknown_joints;
  double unknown_size = 0.0, unknown_rate = 0.0;
  unsigned long seed = 0;
};

/// What a case is played on.
struct Stage {
  Robot robot;    ///< the true one, but for its effects and the spread of `nominal`
  Robot nominal;  ///< that the diagnosis is given
  FamilyRun run;
  bool family = false, vendor = false;
  std::vector<Effect> missing;  ///< of a vendor's model: friction and rotor inertia, as effects
};

/// The kind of case `index` (from 0).
BlindKind kind_of(const BlindOptions& options, int index);
/// Robot, nominal model and motions of a case: another one for each attempt.
Stage stage_of(const Robot& nominal, const BlindOptions& options, int index, int attempt);
/// What is added to the robot, and what is taken out of the library.
Draw draw_case(const Stage& stage, const BlindOptions& options, int index, int attempt);
/// What the logs of a case hold of its effects; of nothing but the family.
struct Recorded {
  std::vector<double> shares;  ///< of each
  double size = 0.0;           ///< rms of all of them together over the joint's torque, where that is largest
};
/// Writes the logs of a case to `folder` (log_a.csv, log_b.csv): one robot, two motions (in the family one or
/// two). Throws Error where the robot leaves its motion.
Recorded record(const Stage& stage, BlindKind kind, const Draw& draw, const std::string& folder);
/// The truth in the words of the diagnosis: a payload's centre of mass in the last link's frame.
/// `tolerance`: relative error of the nominal that is not a gap.
nlohmann::json label_json(const Stage& stage, const Draw& draw, const Recorded& recorded, double tolerance);
/// Puts what the diagnosis said into the case.
void set_answer(const Diagnosis& diagnosis, BlindCase& out);
/// The library without the effects that were put in; nothing where they are not all of it.
std::vector<std::string> all_but(const Stage& stage, const Draw& draw);
/// What was drawn besides, for a person: nothing outside the family.
std::map<std::string, std::string> drawn(const Stage& stage);

}  // namespace dynid::detail
