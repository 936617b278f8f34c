// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <ostream>

#include "app/words.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/number.hpp"

namespace dynid {
namespace {

std::string in_a_list(const std::vector<double>& values) {
  std::string text;
  for (const double x : values) text += (text.empty() ? "" : ":") + short_number(x);
  return text;
}

}  // namespace

void print(std::ostream& out, const SimulateReport& report, const std::string& written_to) {
  out << report.run.log.samples() << " samples of " << report.robot << " along " << report.motion
      << " written to " << written_to << "\n  largest tracking error ["
      << detail::position_units(report.run.truth) << "]  " << in_a_row(report.tracking_error, 3) << "\n";
  for (std::size_t k = 0; k < report.effect_rms.size(); ++k)
    out << "  " << report.run.truth.effects[k].name << ", rms [" << detail::torque_units(report.run.truth)
        << "]  " << in_a_row(report.effect_rms[k], 3) << "\n";
  if (!report.payload.empty()) out << "  payload: " << report.payload << "\n";
}

void print(std::ostream& out, const std::vector<EffectSchema>& effects) {
  out << "Torque added on the measured side; * one value for each joint.\n";
  for (const EffectSchema& spec : effects) {
    out << "\n" << spec.name << ": " << spec.text << "\n";
    for (const EffectParameter& p : spec.parameters) {
      char line[160];
      std::snprintf(line, sizeof line, "  %-22s%-2s%-12s%-16s", p.key.c_str(), p.per_joint ? "*" : "",
                    p.unit == "1" ? "-" : p.unit.c_str(), in_a_list(p.initial).c_str());
      out << line << p.text << "\n";
    }
  }
}

}  // namespace dynid
