// SPDX-License-Identifier: Apache-2.0
#include "app/check.hpp"

#include <cmath>
#include <cstdio>
#include <utility>

#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"

namespace dynid {
namespace detail {
namespace {

std::string text_of(double value) { return short_number(value, 9); }

}  // namespace

void check_positive(const std::string& option, double value) {
  if (!(value > 0.0 && std::isfinite(value))) throw OptionError(option, text_of(value) + " is not positive");
}

void check_not_negative(const std::string& option, double value) {
  if (!(value >= 0.0 && std::isfinite(value)))
    throw OptionError(option, std::isfinite(value) ? text_of(value) + " is negative"
                                                   : text_of(value) + " is not a finite number");
}

void check_within(const std::string& option, double value, double lowest, double highest) {
  if (!(value >= lowest && value <= highest))
    throw OptionError(option, text_of(value) + " is not within " + text_of(lowest) + ".." + text_of(highest));
}

Assumptions assumptions(const std::string& text, int joints) {
  try {
    return parse_assumptions(text, joints);
  } catch (const Error& error) {
    throw OptionError("assume", error.what());
  }
}

AssumedReading read_as_assumed(const std::string& assume, Robot& robot, std::vector<Log>& logs,
                               std::vector<Log>& others) {
  AssumedReading out;
  if (assume.empty() || assume == "auto") out.conventions = find_conventions(robot, logs);
  const std::string text = assume == "auto" ? out.conventions.assume : assume;
  if (text.empty()) return out;
  const Assumptions assumed = assumptions(text, robot.size());
  robot = apply_conventions(assumed, robot);
  for (std::vector<Log>* list : {&logs, &others})
    for (Log& log : *list) log = apply_conventions(assumed, robot, std::move(log));
  out.applied = true;
  return out;
}

}  // namespace detail

std::string OptionError::on_command_line() const {
  std::string name = option_;
  for (char& c : name)
    if (c == '_') c = '-';
  return "--" + name + ": " + rule_;
}

}  // namespace dynid
