// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

/// An option of a use case that is out of range: `cutoff: -1 is not positive`. The option has the name that
/// it has in the job, words joined by `_`; a program that calls it otherwise (`--cutoff`, `~cutoff`) makes
/// its own line of the parts.
class OptionError : public Error {
 public:
  OptionError(const std::string& option, const std::string& rule)
      : Error(option + ": " + rule), option_(option), rule_(rule) {}
  const std::string& option() const noexcept { return option_; }  ///< `rotor_inertia`
  const std::string& rule() const noexcept { return rule_; }      ///< `-1 is not positive`
  /// The line for a command line: `--rotor-inertia: ...`.
  std::string on_command_line() const;

 private:
  std::string option_, rule_;
};

}  // namespace dynid
