// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>

namespace dynid {

/// One line, whatever a library put into its message: control characters become blanks, those at the end go.
inline std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

/// The one exception of the library, thrown by set-up, reading and fitting; never by the real-time kernels.
///
/// what() is one line that names the file, the line or key, the link or joint, and the rule broken. Control
/// characters of what it quotes (a heading of a file, a library's message) become blanks.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& text) : std::runtime_error(one_line(text)) {}
};

}  // namespace dynid
