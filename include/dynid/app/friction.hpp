// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/identification/conventions.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// Section IV-B: friction fitted to what a robot's rigid body leaves of the torques.
struct FrictionJob {
  Robot robot;         ///< its rigid body stays as it is
  std::string source;  ///< what the robot was read from, for messages
  std::vector<Log> logs;
  IdentifyOptions options;  ///< `friction` is the law to fit; `progress` is the context's
  std::string assume;       ///< as IdentifyJob::assume
};

struct FrictionReport {
  TwoStageFriction friction;
  FrictionLaw law = FrictionLaw::linear;
  std::string source;
  ConventionReport conventions;  ///< as IdentifyReport::conventions
  bool conventions_applied = false;
  double seconds = 0.0;

  ModelFile model() const;  ///< the model to write
};

/// As check_options(IdentifyJob).
void check_options(const FrictionJob& job);

/// Allocates. Throws OptionError, Error as identify_friction(), Stopped.
FrictionReport run(const FrictionJob& job, const Context& context = {});

}  // namespace dynid
