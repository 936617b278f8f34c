// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iomanip>
#include <ostream>

#include "dynid/app/text.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

std::string cell(const std::optional<ComparedEffect>& effect) {
  if (!effect) return "-";
  std::vector<std::string> joints;
  for (const int j : effect->joints) joints.push_back(std::to_string(j));
  return "p " + short_number(effect->probability, 2) + ", joints " + join(joints, " ");
}

}  // namespace

void print(std::ostream& out, const CompareReport& report) {
  std::vector<std::vector<std::string>> rows;
  rows.emplace_back(1, "");
  rows.emplace_back(1, "verdict");
  Eigen::Index joints = 0;
  for (const ComparedDiagnosis& d : report.diagnoses) {
    rows[0].push_back(one_line(d.name));
    rows[1].push_back(d.verdict);
    joints = std::max(joints, d.rms.size());
  }
  for (Eigen::Index j = 0; j < joints; ++j) {
    std::string unit;
    std::vector<std::string> row(1);
    for (const ComparedDiagnosis& d : report.diagnoses) {
      row.push_back(j < d.rms.size()
                        ? short_number(d.rms[j], 3) + " (floor " + short_number(d.floor[j], 2) + ")"
                        : "-");
      if (j < d.rms.size()) unit = d.unit[static_cast<std::size_t>(j)];
    }
    row[0] = "gap of joint " + std::to_string(j + 1) + " [" + unit + " rms]";
    rows.push_back(row);
  }
  for (const EffectRow& effect : report.effects) {
    rows.emplace_back(1, with_spaces(effect.name));
    for (const auto& in : effect.in) rows.back().push_back(cell(in));
  }
  rows.emplace_back(1, "the effects take away");
  for (const ComparedDiagnosis& d : report.diagnoses)
    rows.back().push_back(d.shrink ? short_number(100.0 * *d.shrink, 3) + " %" : "-");

  std::vector<std::size_t> width(rows[0].size());
  for (const auto& row : rows)
    for (std::size_t k = 0; k < row.size(); ++k) width[k] = std::max(width[k], row[k].size());
  for (const auto& row : rows) {
    for (std::size_t k = 0; k < row.size(); ++k)
      out << (k > 0 ? "  " : "") << std::left
          << std::setw(k + 1 < row.size() ? static_cast<int>(width[k]) : 0) << row[k];
    out << std::right << "\n";
  }
  if (report.changes.empty()) out << "Nothing is different.\n";
  for (std::size_t k = 1; k < report.diagnoses.size(); ++k) {
    bool first = true;
    for (const Change& change : report.changes) {
      if (change.to != k) continue;
      if (first)
        out << "From " << one_line(report.diagnoses[k - 1].name) << " to "
            << one_line(report.diagnoses[k].name) << ":\n";
      first = false;
      out << "  " << change.text << "\n";
    }
  }
}

}  // namespace dynid
