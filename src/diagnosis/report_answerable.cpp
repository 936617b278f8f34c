// SPDX-License-Identifier: Apache-2.0
#include "report_answerable.hpp"

#include <cmath>
#include <sstream>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid::detail {
namespace {

std::string how_read(const Diagnosis& d) {
  const auto& found = d.conventions.conventions;
  if (found.empty()) return "";
  std::ostringstream out;
  out << (d.verdict == Verdict::misread
              ? "<p class=\"misread\"><b>No: it does not mean what the model takes it "
                "to mean.</b></p>"
              : "<p>Read as assumed:</p>")
      << "<ul class=\"plain\">\n";
  for (const Convention& c : found)
    out << "<li><b>" << html_escaped(capitalised(with_spaces(c.name))) << "</b>: " << html_escaped(c.text)
        << " (the model explains " << std::lround(100.0 * c.explained_before) << "\u00a0% as it stands, "
        << std::lround(100.0 * c.explained_after) << "\u00a0% so)</li>\n";
  out << "</ul><pre>--assume " << html_escaped(d.conventions.assume) << "</pre>\n";
  if (!d.conventions.runner_up.empty())
    out << "<p class=\"note\">The next best reading is " << html_escaped(d.conventions.runner_up)
        << ", with which the model explains " << std::lround(100.0 * d.conventions.runner_up_explained)
        << "\u00a0%.</p>\n";
  return out.str();
}

std::string joints_table(const Answerable& a, const std::vector<std::string>& torque) {
  std::ostringstream out;
  out << "<div class=\"scroll\"><table><thead><tr><th>joint</th><th>travel</th><th>largest speed</th>"
         "<th>in motion</th><th>reversals</th><th>load, rms</th><th>of it varying</th></tr></thead><tbody>\n";
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    const JointExcitation& e = a.joints[j];
    const std::string unit = j < torque.size() && torque[j] == "N" ? "m" : "rad";
    out << "<tr><td>" << j + 1 << "</td><td>" << short_number(e.travel, 3) << "\u00a0" << unit << "</td><td>"
        << short_number(e.speed, 3) << "\u00a0" << unit << "/s</td><td>" << std::lround(100.0 * e.moving)
        << "\u00a0%</td><td>" << e.reversals << "</td><td>" << short_number(e.load, 3) << "\u00a0"
        << (j < torque.size() ? html_escaped(torque[j]) : "") << "</td><td>" << std::lround(100.0 * e.swing)
        << "\u00a0%</td></tr>\n";
  }
  out << "</tbody></table></div>\n";
  return out.str();
}

}  // namespace

std::string answerable_section(const Diagnosis& d) {
  const Answerable& a = d.answerable;
  std::ostringstream out;
  out << "<section id=\"answerable\"><h2>Can this log answer?</h2>\n" << how_read(d);
  out << "<p>" << short_number(a.duration, 3) << " s at " << short_number(a.rate_hz, 4)
      << " Hz, looked at below " << short_number(a.band_hz, 3)
      << " Hz; channels: " << html_escaped(a.channels.empty() ? "none" : list_in_words(a.channels))
      << ".</p>\n";
  if (!a.joints.empty()) out << joints_table(a, d.unit);
  if (!a.blind.empty()) {
    out << "<h3>What could not be seen on it</h3><ul class=\"plain\">\n";
    for (const Blindness& b : a.blind) out << "<li>" << html_escaped(capitalised(b.text)) << ".</li>\n";
    out << "</ul>\n";
  }
  out << "</section>\n";
  return out.str();
}

}  // namespace dynid::detail
