// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/app/diagnose.hpp"
#include "dynid/app/retrieve.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/retrieval/bounds.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// The whole loop without a robot. A log of the published Panda along the letter's motion (Supplementary
/// Table II), as a robot's electronics would give it, is made; the robot is identified from it and its
/// kinematics alone, and made feasible. Then the arm hides something: two logs of random motions, from which
/// the diagnosis is to name it.
struct DemoJob {
  Robot robot;                  ///< the published Panda: 7 joints
  std::string source;           ///< what it was read from, for messages
  std::string log;              ///< what the log is called in messages and in the model's note
  unsigned long seed = 1;       ///< of noise and motions
  Bounds bounds;                ///< of the feasible parameters: a link each
  std::vector<Effect> effects;  ///< that it hides, as parse_effects() makes them; none: an arm as it was
  std::vector<std::string> runs = {"run1.csv", "run2.csv"};  ///< what the logs with the effects are called
};

struct DemoReport {
  Robot truth;  ///< without what it hides
  Log log;
  Identification identification;
  PredictedTorque predicted;   ///< by what was identified, along the log
  RetrieveReport retrieval;    ///< of what was identified
  std::vector<Effect> hidden;  ///< completed
  std::vector<Log> runs;       ///< of the arm that hides it
  DiagnoseReport diagnosis;    ///< of `runs` by the feasible model
  double seconds = 0.0;

  /// A feasible model was found, and the runs could be judged.
  bool succeeded() const { return retrieval.succeeded() && diagnosis.succeeded(); }
  ModelFile model() const;  ///< what was identified, to write
  Table torques() const;    ///< columns t, tau and tauf of every joint
  /// The page: see to_html(). `command` is what makes it again, `version` the program's.
  std::string html(const std::string& command, const std::string& version) const;
};

/// Allocates; on all cores. Throws Error naming the source unless the robot has 7 joints, and as simulate(),
/// identify(), retrieve() and diagnose(), also where no feasible parameters were found; Stopped.
DemoReport run(const DemoJob& job, const Context& context = {});

}  // namespace dynid
