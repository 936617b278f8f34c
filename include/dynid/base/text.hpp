// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace dynid {

/// `a, b, c`. Any range of what can be added to a std::string.
template <class Range>
std::string join(const Range& parts, const char* separator = ", ") {
  std::string out;
  bool first = true;
  for (const auto& part : parts) {
    if (!first) out += separator;
    out += part;
    first = false;
  }
  return out;
}

/// `a`, `a and b`, `a, b and c`.
std::string list_in_words(const std::vector<std::string>& parts);

/// A name of the catalogue for people: `coulomb_friction` -> `coulomb friction`.
std::string with_spaces(std::string name);

/// With a capital first letter, where that is a letter of ASCII.
std::string capitalised(std::string text);

/// `text` fit for the inside of a quoted attribute or an element of XML: & < > " escaped.
std::string xml_escaped(const std::string& text);

/// The same for HTML, where control characters other than tab and line feed are left out: they have no place
/// in a page.
std::string html_escaped(const std::string& text);

/// JSON text fit for a `script` element of HTML: no `</script>` or `<!--` can come of it, and it is the same
/// JSON.
std::string script_escaped(const std::string& json);

/// One word of a POSIX shell's command line: unchanged where nothing in it means anything to a shell, else
/// quoted.
std::string shell_quoted(const std::string& word);

}  // namespace dynid
