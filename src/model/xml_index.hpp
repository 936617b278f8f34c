// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace dynid::detail {

/// One element of an XML text and the bytes that it takes: `[begin, end)` is all of it, `[begin, open_end)`
/// its start tag, `[close_begin, end)` its end tag; an element `<a/>` has open_end == close_begin == end.
struct XmlElement {
  std::string tag;
  std::vector<std::pair<std::string, std::string>> attributes;
  int parent = -1;  ///< index in the list; -1 for the root
  std::size_t line = 0;
  std::size_t begin = 0;
  std::size_t open_end = 0;
  std::size_t close_begin = 0;
  std::size_t end = 0;

  std::string attribute(const char* key) const;  ///< empty when there is none
  bool self_closing() const { return open_end == end; }
};

/// Every element of `text` in the order of their start tags (expat). Throws Error `name:line: reason` when
/// the text is not well-formed.
std::vector<XmlElement> index_xml(const std::string& text, const std::string& name);

}  // namespace dynid::detail
