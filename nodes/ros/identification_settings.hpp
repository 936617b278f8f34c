// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/excite.hpp"
#include "dynid/app/pipeline.hpp"

namespace dynid {

/// What identification_node does with a log, and how: its parameters but those of the node itself (recording,
/// moving, adopting).
struct IdentificationSettings {
  std::string model, base, tip;  ///< the model in use; links, for a URDF that branches
  bool allow_inconsistent = false;
  std::string folder = "identification";
  std::string topic = "/joint_states";  ///< of logs that are bags
  /// Of the commanded positions in logs that are bags: servos are identified from them. Empty: none is read.
  std::string command_topic;
  std::string columns;                     ///< of logs that are CSV, as --columns
  double log_rate = 0.0;                   ///< [Hz] of a CSV log without time; 0: it has time
  std::optional<Eigen::Vector3d> gravity;  ///< [m/s^2] in the base frame: how the arm is mounted
  std::string bounds, prior, validation, reference, collision;  ///< files; empty: none
  /// Options of the steps. `retrieve` is there where `bounds` are, `diagnose` unless it was turned off.
  PipelineJob job;
  ExciteJob excite;  ///< options
};

/// From the parameters as text, by their names in docs/nodes.md. `unknown` takes the names that it does not
/// know. Throws Error in one line that names the parameter: `~cutoff: -1 is negative`.
IdentificationSettings identification_settings(const std::map<std::string, std::string>& parameters,
                                               std::vector<std::string>& unknown);

}  // namespace dynid
