// SPDX-License-Identifier: Apache-2.0
#include "dynid/base/number.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

namespace dynid {
namespace {

constexpr std::size_t longest = 400;  // of a double with 17 decimals: 309 digits, a point, 17 more, a sign

std::string formatted(double x, std::chars_format format, int precision) {
  if (std::isnan(x)) return "nan";  // with no sign
  char buffer[longest];
  const auto result = std::to_chars(buffer, buffer + longest, x, format, precision);
  return std::string(buffer, result.ptr);
}

}  // namespace

std::string exact_number(double x) {
  if (std::isnan(x)) return "nan";
  char buffer[32];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, x).ptr);
}

std::string short_number(double x, int digits) {
  return formatted(x, std::chars_format::general, std::clamp(digits, 1, 17));
}

std::string fixed_number(double x, int decimals) {
  return formatted(x, std::chars_format::fixed, std::clamp(decimals, 0, 17));
}

bool parse_number(const std::string& text, double& value) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (begin != end && *begin == '+' && end - begin > 1 && begin[1] != '-') ++begin;
  double read = 0.0;
  const auto result = std::from_chars(begin, end, read);
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(read)) return false;
  value = read;
  return true;
}

}  // namespace dynid
