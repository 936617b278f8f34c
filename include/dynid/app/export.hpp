// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/coefficient.hpp"

namespace dynid {

enum class ExportFormat {
  urdf,
  mjcf,    ///< MuJoCo
  sdf,     ///< Gazebo
  yaml,    ///< this library's own, coefficients included
  header,  ///< C++
  franka,  ///< the inertials that franka_description reads
};

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
