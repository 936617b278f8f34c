// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>

#include "dynid/app/context.hpp"
#include "dynid/signal/trajectory.hpp"
#include "ros/identification_settings.hpp"

namespace dynid {

/// A file in the folder of the settings.
std::string file_in_folder(const IdentificationSettings& settings, const std::string& name);
/// Makes the folder where it is missing. Throws Error where it cannot be written to.
void make_folder(const IdentificationSettings& settings);

/// Finds a motion that excites the model in use and writes it to `trajectory.csv`. Throws Error, also where
/// none is found within the limits, and Stopped.
Trajectory find_motion(const IdentificationSettings& settings, const Context& context);

/// Identifies, retrieves and diagnoses the log in a file (a bag or CSV), as the settings ask, and writes the
/// files of docs/nodes.md, each whole or not at all and as its step ends. `summary`, if given, takes the
/// summaries of the program. Returns what result.json holds: `{"status": 0|1, "log", "files": {...},
/// "adoptable", "misread", "identification", "retrieval", "diagnosis"}`, the last two null where they were
/// not asked for. Throws Error and Stopped; the files of the steps before stay. Where the log does not mean
/// what the model takes it to mean and no `assume` was given, `misread` says how (else it is empty), and
/// nothing is adoptable.
nlohmann::json identify_log(const IdentificationSettings& settings, const std::string& log,
                            const Context& context, std::ostream* summary);

}  // namespace dynid
