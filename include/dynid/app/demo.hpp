// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/app/context.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// The loop without a robot: a log of the published Panda along the letter's motion (Supplementary Table II),
/// as a robot's electronics would give it, is made, and the robot identified from it and its kinematics
/// alone.
struct DemoJob {
  Robot robot;             ///< the published Panda: 7 joints
  std::string source;      ///< what it was read from, for messages
  std::string log;         ///< what the log is called in messages and in the model's note
  unsigned long seed = 1;  ///< of the log's noise
};

struct DemoReport {
  Robot truth;
  Log log;
  Identification identification;
  PredictedTorque predicted;  ///< by what was identified, along the log
  double seconds = 0.0;

  ModelFile model() const;   ///< the model to write
  Table torques() const;     ///< t, tau1.., tauf1..
  std::string html() const;  ///< the page; its plots are gnuplot's, left out where that is missing
};

/// Allocates. Throws Error naming the source unless the robot has 7 joints, and as simulate() and identify();
/// Stopped.
DemoReport run(const DemoJob& job, const Context& context = {});

}  // namespace dynid
