// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/app/context.hpp"
#include "dynid/identification/reverse.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// Section IV-A: dynamic coefficients from a controller's values of M(q) and g(q).
struct ReverseJob {
  Robot robot;
  std::string source;  ///< what the robot was read from, for messages
  ModelSamples samples;
  ReverseOptions options;
};

struct ReverseReport {
  ReverseIdentification identification;
  std::string source;                  ///< of the robot
  std::string samples;                 ///< source of the samples
  bool physically_consistent = false;  ///< the robot nearest the given one that has the coefficients
  double seconds = 0.0;

  ModelFile model() const;  ///< the model to write
};

/// Throws OptionError: `prune` must not be negative. Does not look at robot and samples.
void check_options(const ReverseJob& job);

/// Allocates. Throws OptionError, Error as reverse_engineer(), Stopped.
ReverseReport run(const ReverseJob& job, const Context& context = {});

}  // namespace dynid
