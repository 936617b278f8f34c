// SPDX-License-Identifier: Apache-2.0
//
// The page of a comparison: figures put into words for src/app/page/compare.html.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/page.hpp"
#include "dynid/app/compare.hpp"
#include "dynid/base/text.hpp"
#include "report_words.hpp"

namespace dynid {
namespace {

using nlohmann::json;
using namespace detail;

/// The largest gap of all joints and diagnoses, in units of its floor: what the longest bar stands for.
double largest(const CompareReport& report) {
  double most = 1.0;
  for (const ComparedDiagnosis& d : report.diagnoses)
    for (Eigen::Index j = 0; j < d.rms.size(); ++j)
      if (const double x = d.rms[j] / d.floor[j]; std::isfinite(x)) most = std::max(most, x);
  return most;
}

json joints_view(const CompareReport& report) {
  json rows = json::array();
  const double most = largest(report);
  Eigen::Index joints = 0;
  for (const ComparedDiagnosis& d : report.diagnoses) joints = std::max(joints, d.rms.size());
  for (Eigen::Index j = 0; j < joints; ++j) {
    json cells = json::array();
    std::string unit;
    for (const ComparedDiagnosis& d : report.diagnoses) {
      if (j >= d.rms.size()) {
        cells.push_back({{"value", "\u2013"}, {"width", "0"}});
        continue;
      }
      unit = d.unit[static_cast<std::size_t>(j)];
      const double times = d.rms[j] / d.floor[j];
      // The floor itself is one; logarithmic, since gaps differ by orders of magnitude.
      const double part = most > 1.0 && times > 1.0 ? std::log(times) / std::log(most) : 0.0;
      cells.push_back({{"value", page_number(d.rms[j])},
                       {"floor", page_number(d.floor[j], "%.2g")},
                       {"times", page_number(times, times < 10.0 ? "%.1f" : "%.0f")},
                       {"width", page_number(100.0 * part, "%.0f")}});
    }
    rows.push_back({{"joint", std::to_string(j + 1)}, {"unit", unit}, {"cells", cells}});
  }
  return rows;
}

json parameters_view(const ComparedEffect& effect, Eigen::Index joints) {
  json lines = json::array();
  for (const ComparedParameter& p : effect.parameters) {
    const bool own = joints > 1 && p.value.size() == joints;
    std::vector<std::string> parts;
    for (Eigen::Index i = 0; i < p.value.size(); ++i) {
      if (own && std::find(effect.joints.begin(), effect.joints.end(), i + 1) == effect.joints.end())
        continue;
      parts.push_back(page_number(p.value[i]));
    }
    lines.push_back(
        {{"key", with_spaces(p.key)}, {"value", join(parts)}, {"unit", p.unit == "1" ? "" : p.unit}});
  }
  return lines;
}

json effects_view(const CompareReport& report) {
  json rows = json::array();
  for (const EffectRow& row : report.effects) {
    json cells = json::array();
    for (std::size_t k = 0; k < row.in.size(); ++k) {
      if (!row.in[k]) {
        cells.push_back({{"found", false}});
        continue;
      }
      const ComparedEffect& effect = *row.in[k];
      const Eigen::Index joints = report.diagnoses[k].rms.size();
      const std::string where = joints_in_words(effect.joints, joints);
      cells.push_back({{"found", true},
                       {"where", where},
                       {"probability", page_probability(effect.probability)},
                       {"share", page_percent(effect.share)},
                       {"parameters", parameters_view(effect, joints)}});
    }
    rows.push_back({{"name", with_spaces(row.name)}, {"cells", cells}});
  }
  return rows;
}

/// The verdicts at both ends, and which effects came and went on the way.
std::string sentence(const CompareReport& report) {
  if (report.changes.empty()) return "Nothing is different.";
  const std::string first = with_spaces(report.diagnoses.front().verdict),
                    last = with_spaces(report.diagnoses.back().verdict);
  std::string text = first == last ? capitalised(first) + " before and after."
                                   : capitalised(first) + " \u2192 " + last + ".";
  for (const Change& change : report.changes)
    if (change.kind == Change::Kind::gone || change.kind == Change::Kind::appeared)
      text += " " + capitalised(change.text) + ".";
  return text;
}

/// ` -> ` as a page writes it.
std::string with_arrows(std::string text) {
  for (std::size_t at = 0; (at = text.find(" -> ", at)) != std::string::npos;)
    text.replace(at, 4, " \u2192 ");
  return text;
}

json steps_view(const CompareReport& report) {
  json steps = json::array();
  for (std::size_t k = 1; k < report.diagnoses.size(); ++k) {
    json changes = json::array();
    for (const Change& change : report.changes)
      if (change.to == k) changes.push_back({{"text", with_arrows(capitalised(change.text))}});
    steps.push_back({{"from", report.diagnoses[k - 1].name},
                     {"to", report.diagnoses[k].name},
                     {"any", !changes.empty()},
                     {"changes", changes}});
  }
  return steps;
}

}  // namespace

std::string CompareReport::html(const std::string& command, const std::string& version) const {
  json columns = json::array();
  for (const ComparedDiagnosis& d : diagnoses)
    columns.push_back({{"name", d.name},
                       {"verdict", capitalised(with_spaces(d.verdict))},
                       {"tone", verdict_tone(d.verdict)},
                       {"shrink", d.shrink ? page_percent(std::max(0.0, *d.shrink)) : "\u2013"}});
  const json joints = joints_view(*this), found = effects_view(*this);
  return rendered_page("compare", {{"sentence", sentence(*this)},
                                   {"count", std::to_string(diagnoses.size())},
                                   {"columns", columns},
                                   {"steps", steps_view(*this)},
                                   {"any_joint", !joints.empty()},
                                   {"joints", joints},
                                   {"any_effect", !found.empty()},
                                   {"effects", found},
                                   {"command", command},
                                   {"version", version}});
}

}  // namespace dynid
