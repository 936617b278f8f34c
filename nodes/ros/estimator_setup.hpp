// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/uncertainty.hpp"
#include "ros/estimator_core.hpp"
#include "ros/estimator_frames.hpp"
#include "ros/parameters.hpp"

namespace dynid {

/// A model as torque_estimator_node has it from a file.
struct EstimatorModel {
  std::string path;
  ModelFile file;
  std::optional<Uncertainty> uncertainty;  ///< of the residual, where the file has it
  std::vector<Inconsistency> broken;       ///< links that no body can have
  std::vector<std::string> uncompensated;  ///< effects of the model that are left out
};

/// Private parameters of torque_estimator_node, read once at the start and checked.
struct EstimatorSetup {
  EstimatorModel model;
  std::vector<std::string> joints;  ///< as the messages name them, base to tip
  EstimatorCoreOptions core;
  EstimatorFramesOptions frames;
  LinkInertia payload;
  bool assumed = false;            ///< the messages are read as ~assume says
  std::string topic;               ///< of the joint states
  int queue = 0;                   ///< of the subscription and of what is published
  double silence = 0.0;            ///< [s] without a message that is an error
  double tf_period = 0.0;          ///< [s]
  double diagnostic_period = 0.0;  ///< [s]
  double reading_window = 0.0;     ///< [s] of a ReadingWatch
};

/// Throws Error, one line that begins with the parameter's full name.
EstimatorSetup read_estimator_setup(const Parameters& parameters);
/// The file named by ~model, with ~base and ~tip for a URDF. A model that no body can have is taken, and
/// said. Effects that the loop cannot compute are refused by name, or with ~uncompensated_effects `ignore`
/// left out, and said.
EstimatorModel read_estimator_model(const Parameters& parameters);
/// ~payload/mass, ~payload/com, ~payload/inertia.
LinkInertia read_estimator_payload(const Parameters& parameters);

}  // namespace dynid
