// SPDX-License-Identifier: Apache-2.0
#include <iomanip>
#include <ostream>

#include "dynid/app/text.hpp"

namespace dynid {
namespace {

void print(std::ostream& out, const ServoFit& fit) {
  out << "joint " << fit.joint << " (" << fit.name << ")";
  if (!fit.identified) {
    out << ": " << fit.remarks.front() << "\n";
    return;
  }
  out << ": mean absolute error " << 1e3 * fit.error << " mrad fitted, " << 1e3 * fit.held_out
      << " mrad left out" << (fit.si ? "" : "; ratios only") << "\n";
  for (const ServoValue& v : fit.values) {
    out << "  " << std::left << std::setw(24) << v.name << std::right << std::setw(12) << v.value << " ["
        << v.low << ", " << v.high << "]";
    if (v.unit != "1") out << " " << v.unit;
    out << "\n";
  }
  for (const ServoTerm& t : fit.terms)
    if (t.kept)
      out << "  " << t.name << " kept: " << 1e3 * t.without << " to " << 1e3 * t.with << " mrad left out\n";
  for (const ServoAlias& a : fit.aliases) {
    out << "  not told apart: " << a.first << ", " << a.second;
    if (a.correlation != 0.0) out << " (correlation " << a.correlation << ")";
    out << "\n";
  }
  for (const std::string& remark : fit.remarks) out << "  " << remark << "\n";
}

}  // namespace

void print(std::ostream& out, const IdentifyServosReport& report) {
  out << "Servos of " << report.identification.robot.name << " from " << report.logs.size()
      << (report.logs.size() == 1 ? " log" : " logs") << "; intervals at " << 100.0 * report.confidence
      << " %\n"
      << std::setprecision(4);
  for (const ServoFit& fit : report.identification.joints) print(out, fit);
  for (const DataIssue& issue : report.identification.issues) out << issue.text << "\n";
}

void print(std::ostream& out, const ReplayReport& report) {
  out << "Open loop from the first of " << report.replay.t.size()
      << " samples, mean absolute error of the position\n"
      << "  model [rad]            " << in_a_row(report.replay.error) << "\n"
      << "  perfect tracking [rad] " << in_a_row(report.tracking) << "\n";
}

}  // namespace dynid
