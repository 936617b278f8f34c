// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "dynid/signal/log.hpp"

namespace dynid {

/// Reads logs of kinds that this program does not know itself; empty: a kind that it leaves to the program.
/// The Python package brings one along, which is set before any command runs.
using LogReader = std::function<std::optional<Log>(const std::string& path, const LogOptions& options,
                                                   const std::string& topic)>;
void set_log_reader(LogReader reader);

}  // namespace dynid
