// SPDX-License-Identifier: Apache-2.0
#include "base/yaml.hpp"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"

namespace dynid::detail {
namespace {

/// Hears of a document's parts and keeps none.
struct Deaf : YAML::EventHandler {
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
  }
  void OnMapEnd() override {}
};

/// The first document, and a second one, empty, where there are more. YAML::LoadAll() would never end on some
/// texts that are no YAML: it takes no step from one document to the next.
std::vector<YAML::Node> first_documents(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  Deaf deaf;
  std::vector<YAML::Node> documents;
  if (parser.HandleNextDocument(deaf)) documents.push_back(YAML::Load(text));
  if (parser.HandleNextDocument(deaf)) documents.emplace_back();
  return documents;
}

}  // namespace

YamlItem YamlItem::document(const std::string& text, const std::string& file, const char* format,
                            const char* what) {
  const std::string expected = std::string("expected ") + what + " (format: " + format + ")";
  std::vector<YAML::Node> documents;
  try {
    documents = first_documents(text);
  } catch (const YAML::Exception& error) {
    const std::string line = error.mark.is_null() ? "" : ":" + std::to_string(error.mark.line + 1);
    throw Error(file + line + ": " + error.msg);
  }
  if (documents.empty() || documents[0].IsNull()) throw Error(file + ": is empty, " + expected);
  YamlItem root(documents[0], "", std::make_shared<const std::string>(file));
  if (documents.size() > 1) root.fail("holds more than one document");
  if (!root.node_.IsMap()) root.fail(expected);
  const YamlItem found = root.at("format");
  if (found.text() != format)
    found.fail(std::string("expected ") + format + ", found '" + found.text() + "'");
  return root;
}

void YamlItem::fail(const std::string& what) const {
  const std::string line = mark_.is_null() ? "" : ":" + std::to_string(mark_.line + 1);
  throw LocatedError(*file_ + line + ": " + (path_.empty() ? "" : path_ + ": ") + what);
}

void YamlItem::expect_map() const {
  if (!node_.IsMap()) fail(std::string("expected a map, found ") + kind());
}

void YamlItem::expect_keys(const std::vector<std::string>& known) const {
  expect_map();
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    const YamlItem key(entry.first, path_, file_);
    if (!entry.first.IsScalar()) key.fail("a key is not a word");
    const std::string& name = entry.first.Scalar();
    if (std::find(known.begin(), known.end(), name) == known.end()) key.fail("unknown key '" + name + "'");
    if (!seen.insert(name).second) key.fail("key '" + name + "' appears twice");
  }
}

bool YamlItem::has(const std::string& key) const { return node_.IsMap() && node_[key]; }

YamlItem YamlItem::at(const std::string& key) const {
  expect_map();
  const YAML::Node child = node_[key];
  if (!child) YamlItem(node_, path_of(key), file_).fail("missing");
  YamlItem item(child, path_of(key), file_);
  if (child.IsNull()) {  // nothing stands wherever the next thing does
    for (const auto& entry : node_)
      if (entry.first.IsScalar() && entry.first.Scalar() == key) item.mark_ = entry.first.Mark();
  }
  return item;
}

std::vector<YamlItem> YamlItem::list() const {
  if (!node_.IsSequence()) fail(std::string("expected a list, found ") + kind());
  std::vector<YamlItem> items;
  for (std::size_t k = 0; k < node_.size(); ++k)
    items.push_back(YamlItem(node_[k], path_ + "[" + std::to_string(k + 1) + "]", file_));
  return items;
}

std::vector<std::pair<std::string, YamlItem>> YamlItem::entries() const {
  expect_map();
  std::vector<std::pair<std::string, YamlItem>> items;
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    const YamlItem at_key(entry.first, path_, file_);
    const std::string key = at_key.name();
    if (!seen.insert(key).second) at_key.fail("key '" + key + "' appears twice");
    items.emplace_back(key, YamlItem(entry.second, path_of(key), file_));
  }
  return items;
}

double YamlItem::number() const {
  double value = 0.0;
  if (!node_.IsScalar()) fail(std::string("expected a number, found ") + kind());
  if (!parse_number(node_.Scalar(), value)) fail("expected a finite number, found '" + node_.Scalar() + "'");
  return value;
}

double YamlItem::positive_number() const {
  const double value = number();
  if (!(value > 0.0)) fail("expected a positive number, found " + exact_number(value));
  return value;
}

int YamlItem::integer() const {
  const double value = number();
  if (value != std::floor(value) || std::abs(value) > double(std::numeric_limits<int>::max()))
    fail("expected a whole number, found '" + node_.Scalar() + "'");
  return static_cast<int>(value);
}

bool YamlItem::boolean() const {
  const std::string value = text();
  if (value != "true" && value != "false") fail("expected true or false, found '" + value + "'");
  return value == "true";
}

std::string YamlItem::text() const {
  if (!node_.IsScalar()) fail(std::string("expected a text, found ") + kind());
  return node_.Scalar();
}

std::string YamlItem::name() const {
  std::string value = text();
  if (value.empty()) fail("expected a name, found an empty text");
  return value;
}

std::vector<YamlItem> YamlItem::numbers(std::size_t count) const {
  const std::string expected = "expected " + std::to_string(count) + " numbers, found ";
  if (!node_.IsSequence()) fail(expected + kind());
  if (node_.size() != count) fail(expected + std::to_string(node_.size()));
  return list();
}

std::pair<double, double> YamlItem::interval() const {
  if (!node_.IsSequence() || node_.size() != 2) fail("expected [lower, upper]");
  const std::vector<YamlItem> ends = list();
  const std::pair<double, double> both{ends[0].number(), ends[1].number()};
  if (both.first > both.second) fail("the bounds cross: the lower one is above the upper one");
  return both;
}

const char* YamlItem::kind() const {
  switch (node_.Type()) {
    case YAML::NodeType::Map:
      return "a map";
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Scalar:
      return "a single value";
    default:
      return "nothing";
  }
}

}  // namespace dynid::detail
