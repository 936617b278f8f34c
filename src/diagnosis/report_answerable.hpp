// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid::detail {

/// The report's first section, "Can this log answer?", as XML: what was recorded, how the joints move, how
/// the logs are read, and what could not be seen on them.
std::string answerable_section(const Diagnosis& diagnosis);

}  // namespace dynid::detail
