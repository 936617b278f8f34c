// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <ostream>

#include "app/words.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/text.hpp"

namespace dynid {

void print(std::ostream& out, const DiagnoseReport& report) {
  const Diagnosis& d = report.diagnosis;
  out << "Verdict: " << to_string(d.verdict) << "\n";
  const bool applied = d.verdict != Verdict::misread;
  for (const Convention& c : d.conventions.conventions)
    out << "  " << (applied ? "read as assumed: " : "") << c.text << " (the model explains "
        << std::lround(100.0 * c.explained_before) << " % of it as it stands, "
        << std::lround(100.0 * c.explained_after) << " % so)\n";
  for (const std::string& other : d.conventions.equivalents)
    out << "  (the log does not tell this from " << other << ")\n";
  if (!d.conventions.undecided_text.empty()) out << "  note: " << d.conventions.undecided_text << "\n";
  if (!applied) {
    out << "Next: " << d.next.text << "\n";
    return;
  }
  out << "  gap [" << detail::units_in_words(d.unit) << " rms]: " << in_a_row(d.rms)
      << "\n  noise floor: " << in_a_row(d.floor) << "\n  at most (95 %): " << in_a_row(d.upper)
      << "\n  of no account:  " << in_a_row(d.tolerance)
      << "\n  chance that a robot which the model describes to within the tolerance shows such a gap: "
      << d.p_value << "\n";
  for (const FoundEffect& e : d.effects) {
    out << "  " << e.effect.name << " on joint" << (e.effect.joints.size() > 1 ? "s" : "");
    for (const int j : e.effect.joints) out << " " << j;
    out << ": probability " << e.probability << ", share " << e.share;
    for (std::size_t k = 0; k < e.aliases.size(); ++k)
      out << (k == 0 ? "; not told from " : ", ") << e.aliases[k];
    out << "\n";
    for (const ParameterEstimate& p : e.parameters) {
      const int digits = p.value.cwiseAbs().maxCoeff() < 1e5 ? 4 : 13;  // a stamp counts from 1970
      out << "    " << p.key << " " << in_a_row(p.value, digits) << " [" << p.unit << "]\n";
    }
    if (const std::string place = detail::payload_place(report.nominal, e.effect); !place.empty())
      out << "    " << place << "\n";
  }
  if (d.effects.empty()) {  // what was weighed, and what stopped it
    for (const ConsideredEffect& e : d.considered) {
      out << "  weighed: " << e.name << " on joint" << (e.joints.size() > 1 ? "s" : "");
      for (const int j : e.joints) out << " " << j;
      out << ": probability " << e.probability << ", share " << e.share << "\n";
    }
    if (!d.considered.empty())
      for (const Judgement& j : d.judgement)
        if (!j.passed)
          out << "  not met: " << j.text << " (" << j.value << ", threshold " << j.threshold << ")\n";
  }
  if (!d.effects.empty())
    out << "  the gap shrinks by " << 100.0 * d.shrink.fraction << " % (" << 100.0 * d.shrink.low << " to "
        << 100.0 * d.shrink.high << " %) on data not used\n";
  if (!d.smallest_visible.empty()) {
    const auto least = std::max_element(
        d.smallest_visible.begin(), d.smallest_visible.end(),
        [](const VisibleSize& a, const VisibleSize& b) { return a.torque_rms < b.torque_rms; });
    out << "  would have been named on any joint: " << least->name << " and simpler ones of "
        << least->torque_rms << " N m rms\n";
  }
  out << "Next: " << d.next.text << "\n";
}

void print(std::ostream& out, const BlindReport& report) {
  const BlindScore& s = report.score;
  out << s.cases << " cases, seed " << report.options.seed << "\n  no gap: " << s.false_alarms << " of "
      << s.no_gap << " given an effect\n  first effect right: " << s.first_right << " of " << s.known << " ("
      << s.class_right << " with its declared aliases)\n  within the tolerance: " << s.known_within
      << " of these, called no gap " << s.known_within_clean << "\n  both of a pair: " << s.both_found
      << " of " << s.pairs;
  if (s.attainable > 0)
    out << "\n  named of what is where only the true effects are sought: " << s.attainable_named << " of "
        << s.attainable << ", first " << s.first_right_attainable << " of " << s.known_attainable
        << ", both of a pair " << s.both_found_attainable << " of " << s.pairs_attainable;
  out << "\n  unknown called unexplained: " << s.abstained << " of " << s.unknown
      << "\n  wrong at a probability of 0.9 or more: " << s.confident_wrong << "\n  calibration error "
      << s.calibration_error << ", intervals cover " << s.covered << " of " << s.intervals
      << "\n  median parameter error " << s.parameter_error << ", median shrink " << s.shrink << " ("
      << s.shrink_of_true << " of what the true effects give)\n";
  for (const auto& [truth, named] : s.confusion) {
    out << "  " << std::setw(34) << std::left << truth << std::right;
    for (const auto& [name, count] : named) out << " " << name << " " << count << ";";
    out << "\n";
  }
}

}  // namespace dynid
