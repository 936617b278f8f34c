// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynid/signal/log.hpp"

namespace dynid::python {

/// A log as Python holds it: never changed once it is made, its arrays are views of it.
using PyLog = std::shared_ptr<Log>;

/// What a job takes: of each log its robot's columns, in the robot's order. Throws Error naming the log.
std::vector<Log> logs_of(const std::vector<PyLog>& logs, bool need_dq, bool need_tau);

}  // namespace dynid::python
