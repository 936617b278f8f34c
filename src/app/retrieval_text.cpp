// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ostream>

#include "dynid/app/text.hpp"

namespace dynid {

void print(std::ostream& out, const RetrieveReport& report) {
  const RetrievalResult& result = report.result;
  out << (result.feasible ? "Feasible parameters of " : "No feasible parameters of ") << report.robot.name
      << " after " << result.runs.size() << " runs" << (result.interrupted ? " (interrupted)" : "") << ", "
      << result.seconds << " s\n  phi " << result.objective << ", total mass " << result.total_mass
      << " kg\n";
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const LinkInertia& link = result.links[i];
    out << "  " << report.robot.joints[i].link_name << ": mass " << link.mass << " +- "
        << result.spread[static_cast<Eigen::Index>(10 * i)] << " kg, com [" << link.com.transpose()
        << "] m\n";
  }
  out << "  active constraints:";
  for (const ConstraintMargin& c : result.constraints)
    if (c.active) out << " " << c.name << ",";
  out << "\n";
  for (const ConstraintMargin& c : result.constraints)
    if (c.margin < 0.0) out << "  violated: " << c.name << ", margin " << c.margin << "\n";
}

std::string in_words(const LimitMargin& m) {
  char value[64];
  std::snprintf(value, sizeof value, "%.3g %s (%.1f %%)", m.margin, m.unit.c_str(), 100.0 * m.share);
  std::string text = m.name;
  if (m.joint > 0) text += " of joint " + std::to_string(m.joint);
  if (m.between.size() == 2) text += " of " + m.between[0] + " and " + m.between[1];
  return text + ": " + value;
}

void print(std::ostream& out, const ExciteReport& report, const std::string& written_to) {
  const Excitation& found = report.found;
  const MotionShape& shape = found.motion.shape();
  out << "Exciting motion of " << report.robot.name << ": " << shape.duration << " s, " << shape.harmonics
      << " harmonics, base period " << 2.0 * M_PI / shape.omega << " s, written to " << written_to << "\n"
      << "  condition number " << found.condition_number << " (" << found.columns << " columns)";
  if (!report.compared.empty())
    out << ", that of " << report.compared << " " << report.compared_condition_number;
  out << "\n  "
      << (report.collision.empty() ? "collisions are not checked: no --collision file"
                                   : "clear of collisions by " + report.collision)
      << "\n  margins, least share of the limit first:\n";
  std::vector<LimitMargin> margins = found.margins;
  std::stable_sort(margins.begin(), margins.end(),
                   [](const LimitMargin& x, const LimitMargin& y) { return x.share < y.share; });
  for (std::size_t k = 0; k < std::min<std::size_t>(8, margins.size()); ++k)
    out << "    " << in_words(margins[k]) << "\n";
}

}  // namespace dynid
