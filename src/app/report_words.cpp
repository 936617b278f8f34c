// SPDX-License-Identifier: Apache-2.0
#include "report_words.hpp"

#include <cmath>
#include <cstdio>

#include "dynid/base/text.hpp"

namespace dynid::detail {

std::string page_number(double x, const char* format) {
  if (!std::isfinite(x)) return "\u2013";
  char text[40];
  std::snprintf(text, sizeof text, format, std::abs(x) < 1e-12 ? 0.0 : x);
  std::string out = text;
  if (out[0] == '-') out = "\u2212" + out.substr(1);
  return out;
}

std::string page_percent(double part) {
  if (part > 0.0 && part < 0.005) return "<1\u00a0%";
  if (part >= 0.995) return ">99\u00a0%";
  return page_number(std::round(100.0 * part), "%.0f") + "\u00a0%";
}

std::string page_percents(double low, double high) {
  const std::string from = page_percent(low), to = page_percent(high);
  return from == to ? from : from + " to " + to;
}

std::string page_angle(double x) {
  return x < 1.0 ? page_number(1e3 * x) + "\u00a0mrad" : page_number(x) + "\u00a0rad";
}

std::string page_probability(double p) {
  if (p > 0.995) return ">0.99";
  if (p > 0.0 && p < 0.005) return "<0.01";
  return page_number(p, "%.2f");
}

std::string joints_in_words(const std::vector<int>& joints, Eigen::Index of) {
  if (joints.empty() || static_cast<Eigen::Index>(joints.size()) == of) return "";
  std::vector<std::string> parts;
  for (const int j : joints) parts.push_back(std::to_string(j));
  return std::string(joints.size() > 1 ? "joints " : "joint ") + list_in_words(parts);
}

const char* verdict_tone(const std::string& verdict) {
  if (verdict == "no_gap" || verdict == "explained") return "good";
  if (verdict == "partly_explained") return "warn";
  return verdict == "not_detected" ? "calm" : "bad";
}

}  // namespace dynid::detail
