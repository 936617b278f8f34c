// SPDX-License-Identifier: Apache-2.0
#include "ros/text_parameters.hpp"

#include <charconv>
#include <sstream>

#include "dynid/base/number.hpp"

namespace dynid {
namespace {

/// All of `text` as a number of type T.
template <class T>
T parsed(const std::string& name, const std::string& text, const char* kind) {
  T value{};
  const char *first = text.data(), *last = first + text.size();
  const std::from_chars_result end = std::from_chars(first, last, value);
  if (end.ec != std::errc() || end.ptr != last) throw OptionError(name, text + " is not " + kind);
  return value;
}

}  // namespace

std::optional<std::vector<double>> numbers_in(std::string text) {
  const auto blank = [](unsigned char c) { return std::isspace(c) != 0; };
  text.erase(std::remove_if(text.begin(), text.end(), blank), text.end());
  if (text.size() >= 2 && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);
  std::vector<double> all;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    double value = 0.0;
    if (!parse_number(part, value)) return std::nullopt;
    all.push_back(value);
  }
  if (all.empty() || text.back() == ',') return std::nullopt;
  return all;
}

bool TextParameters::find(const std::string& name, std::string& text) {
  asked_.insert(name);
  const auto found = texts_.find(name);
  if (found == texts_.end()) return false;
  text = found->second;
  return true;
}

void TextParameters::read(const std::string& name, std::string& value) { find(name, value); }

void TextParameters::read(const std::string& name, bool& value) {
  std::string text;
  if (!find(name, text)) return;
  if (text != "true" && text != "1" && text != "false" && text != "0")
    throw OptionError(name, text + " is not true or false");
  value = text == "true" || text == "1";
}

void TextParameters::read(const std::string& name, double& value) {
  std::string text;
  if (find(name, text)) value = parsed<double>(name, text, "a number");
}

void TextParameters::read(const std::string& name, int& value) {
  std::string text;
  if (find(name, text)) value = parsed<int>(name, text, "a whole number");
}

void TextParameters::read(const std::string& name, unsigned& value) {
  std::string text;
  if (find(name, text)) value = parsed<unsigned>(name, text, "a whole number from 0");
}

void TextParameters::read(const std::string& name, std::uint64_t& value) {
  std::string text;
  if (find(name, text)) value = parsed<std::uint64_t>(name, text, "a whole number from 0");
}

void TextParameters::read(const std::string& name, std::optional<Eigen::Vector3d>& value) {
  std::string text;
  if (!find(name, text)) return;
  const auto numbers = numbers_in(text);
  if (!numbers || numbers->size() != 3) throw OptionError(name, text + " is not three numbers, [x, y, z]");
  value = Eigen::Map<const Eigen::Vector3d>(numbers->data());
}

std::vector<std::string> TextParameters::unread() const {
  std::vector<std::string> names;
  for (const auto& [name, text] : texts_)
    if (asked_.count(name) == 0) names.push_back(name);
  return names;
}

}  // namespace dynid
