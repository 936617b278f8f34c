// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace dynid {

/// Runs `dynid WORDS...` in this process and returns its exit status, 0 or 1; what would be 2 is thrown as
/// Error.
int run_command(const std::vector<std::string>& words);

/// Throws Error where the words are no command, or its options are not in their ranges; nothing is done.
void check_command(const std::vector<std::string>& words);

}  // namespace dynid
