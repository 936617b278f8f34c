// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iomanip>
#include <ostream>

#include "dynid/app/text.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {

void print(std::ostream& out, const FleetReport& report) {
  std::size_t width = 5;
  for (const FleetEntry& e : report.entries) width = std::max(width, one_line(e.member.robot).size());
  const auto first = [&](const std::string& text) -> std::ostream& {
    return out << std::left << std::setw(static_cast<int>(width) + 2) << text << std::right;
  };
  first("robot") << "     gap  verdict and causes (gap: 1 is of no account)\n";
  for (const FleetEntry& e : report.entries) {
    first(one_line(e.member.robot));
    if (!e.error.empty()) {
      out << "       -  not diagnosed: " << one_line(e.error) << "\n";
      continue;
    }
    out << std::setw(8) << short_number(e.gap, 3) << "  " << with_spaces(e.diagnosis.verdict);
    for (const ComparedEffect& effect : e.diagnosis.effects)
      out << (&effect == &e.diagnosis.effects.front() ? ": " : ", ") << with_spaces(effect.name) << " ("
          << short_number(effect.probability, 2) << ")";
    out << "\n";
  }
  for (const FleetCause& cause : report.causes)
    out << cause.entries.size() << (cause.entries.size() == 1 ? " robot: " : " robots: ")
        << (cause.effects.empty() ? with_spaces(cause.verdict) : with_spaces(join(cause.effects, ", ")))
        << "\n";
}

}  // namespace dynid
