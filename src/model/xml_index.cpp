// SPDX-License-Identifier: Apache-2.0
#include "xml_index.hpp"

#include <expat.h>

#include <memory>

#include "dynid/base/error.hpp"

namespace dynid::detail {
namespace {

struct Scan {
  XML_Parser parser = nullptr;
  std::vector<XmlElement> elements;
  int open = -1;  // the innermost element that is still open
};

std::size_t position(XML_Parser parser) { return static_cast<std::size_t>(XML_GetCurrentByteIndex(parser)); }

void XMLCALL on_start(void* data, const XML_Char* tag, const XML_Char** attributes) {
  Scan& scan = *static_cast<Scan*>(data);
  XmlElement element;
  element.tag = tag;
  for (const XML_Char** a = attributes; *a != nullptr; a += 2) element.attributes.emplace_back(a[0], a[1]);
  element.parent = scan.open;
  element.line = static_cast<std::size_t>(XML_GetCurrentLineNumber(scan.parser));
  element.begin = position(scan.parser);
  element.open_end = element.begin + static_cast<std::size_t>(XML_GetCurrentByteCount(scan.parser));
  scan.open = static_cast<int>(scan.elements.size());
  scan.elements.push_back(std::move(element));
}

void XMLCALL on_end(void* data, const XML_Char*) {
  Scan& scan = *static_cast<Scan*>(data);
  XmlElement& element = scan.elements[static_cast<std::size_t>(scan.open)];
  const auto bytes = static_cast<std::size_t>(XML_GetCurrentByteCount(scan.parser));
  element.close_begin = bytes == 0 ? element.open_end : position(scan.parser);  // no bytes: <a/>
  element.end = element.close_begin + bytes;
  scan.open = element.parent;
}

}  // namespace

std::string XmlElement::attribute(const char* key) const {
  for (const auto& [name, value] : attributes) {
    if (name == key) return value;
  }
  return "";
}

std::vector<XmlElement> index_xml(const std::string& text, const std::string& name) {
  const std::unique_ptr<XML_ParserStruct, void (*)(XML_Parser)> parser(XML_ParserCreate(nullptr),
                                                                       XML_ParserFree);
  Scan scan;
  scan.parser = parser.get();
  XML_SetUserData(scan.parser, &scan);
  XML_SetElementHandler(scan.parser, on_start, on_end);
  if (XML_Parse(scan.parser, text.data(), static_cast<int>(text.size()), XML_TRUE) != XML_STATUS_OK) {
    throw Error(name + ":" + std::to_string(XML_GetCurrentLineNumber(scan.parser)) +
                ": malformed XML: " + XML_ErrorString(XML_GetErrorCode(scan.parser)));
  }
  return std::move(scan.elements);
}

}  // namespace dynid::detail
