// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace dynid {

/// The one exception of the library, thrown by set-up, reading and fitting; never by the real-time kernels.
///
/// what() is one line that names the file, the line or key, the link or joint, and the rule broken.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& text) : std::runtime_error(text) {}
};

}  // namespace dynid
