// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/export_format.hpp"

namespace dynid {

/// A model in the words of another program.
struct ExportJob {
  /// A URDF whose inertials and joint dynamics are replaced, the rest untouched.
  struct Into {
    std::string text;
    std::string source;  ///< its file, for messages
  };
  ModelFile model;
  ExportFormat format = ExportFormat::urdf;
  std::optional<Into> into;  ///< with ExportFormat::urdf alone
};

struct ExportReport {
  std::string robot;  ///< its name
  ExportFormat format = ExportFormat::urdf;
  std::string text;
  std::vector<std::string> not_expressed;  ///< what of the robot the format cannot say, one line each
};

/// Throws OptionError: `into` goes with format urdf alone.
void check_options(const ExportJob& job);

/// Allocates. Throws OptionError, Error as to_urdf(), to_mjcf() and the others, Stopped.
ExportReport run(const ExportJob& job, const Context& context = {});

}  // namespace dynid
