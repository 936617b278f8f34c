// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/compare.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "app/compared.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

using nlohmann::json;

// A joint's gap has changed where it did so by more than the noise floor and by more than what another
// motion of the same robot does to it.
constexpr double least_change = 0.2;

double number(const json& x) {
  return x.is_null() ? std::numeric_limits<double>::quiet_NaN() : x.get<double>();
}

Eigen::VectorXd numbers(const json& x) {
  if (x.is_null()) return {};
  if (!x.is_array()) return Eigen::VectorXd::Constant(1, number(x));
  Eigen::VectorXd out(static_cast<Eigen::Index>(x.size()));
  for (Eigen::Index i = 0; i < out.size(); ++i) out[i] = number(x.at(static_cast<std::size_t>(i)));
  return out;
}

ComparedEffect effect_of(const json& x) {
  ComparedEffect effect;
  effect.name = x.at("name").get<std::string>();
  effect.joints = x.at("joints").get<std::vector<int>>();
  effect.probability = number(x.at("probability"));
  effect.share = number(x.at("share"));
  for (const auto& [key, p] : x.at("parameters").items())
    effect.parameters.push_back({key, p.at("unit").get<std::string>(), numbers(p.at("value")),
                                 numbers(p.at("low")), numbers(p.at("high"))});
  return effect;
}

void check_alike(const ComparedDiagnosis& a, const ComparedDiagnosis& b) {
  if (a.rms.size() == 0 || b.rms.size() == 0) return;
  if (a.rms.size() != b.rms.size())
    throw Error(b.name + ": " + std::to_string(b.rms.size()) + " joints, " + a.name + " has " +
                std::to_string(a.rms.size()) + ": only robots of one type can be compared");
  if (a.unit != b.unit) throw Error(b.name + ": joints of other types than those of " + a.name);
}

/// The place of `effect` in the table: a row of that name that the diagnosis `k` is not in yet, one with the
/// same joints first.
EffectRow& row_for(std::vector<EffectRow>& rows, const ComparedEffect& effect, std::size_t k,
                   std::size_t of) {
  EffectRow* found = nullptr;
  for (EffectRow& row : rows) {
    if (row.name != effect.name || row.in[k]) continue;
    const bool same_joints = std::any_of(row.in.begin(), row.in.end(), [&](const auto& other) {
      return other && other->joints == effect.joints;
    });
    if (found == nullptr || same_joints) found = &row;
    if (same_joints) break;
  }
  if (found != nullptr) return *found;
  rows.push_back({effect.name, std::vector<std::optional<ComparedEffect>>(of)});
  return rows.back();
}

std::string joints_of(const ComparedEffect& effect, Eigen::Index n) {
  if (effect.joints.empty() || static_cast<Eigen::Index>(effect.joints.size()) == n) return "";
  std::vector<std::string> parts;
  for (const int j : effect.joints) parts.push_back(std::to_string(j));
  return (parts.size() > 1 ? " on joints " : " on joint ") + list_in_words(parts);
}

/// Whether number `i` of two estimates cannot be the same: the intervals lie apart.
bool apart(const ComparedParameter& a, const ComparedParameter& b, Eigen::Index i) {
  if (i >= a.low.size() || i >= a.high.size() || i >= b.low.size() || i >= b.high.size()) return false;
  return a.high[i] < b.low[i] || b.high[i] < a.low[i];
}

std::string parameter_change(const ComparedEffect& a, const ComparedEffect& b, Eigen::Index n) {
  std::string text;
  for (const ComparedParameter& p : a.parameters) {
    const auto other = std::find_if(b.parameters.begin(), b.parameters.end(),
                                    [&](const ComparedParameter& x) { return x.key == p.key; });
    if (other == b.parameters.end() || other->value.size() != p.value.size()) continue;
    for (Eigen::Index i = 0; i < p.value.size(); ++i) {
      if (!apart(p, *other, i)) continue;
      const bool own = p.value.size() == n && n > 1;
      text += (text.empty() ? "" : ", ") + p.key +
              (own ? " of joint " + std::to_string(i + 1) : std::string()) + " " +
              short_number(p.value[i], 4) + " -> " + short_number(other->value[i], 4) + " " + p.unit;
    }
  }
  return text;
}

void find_changes(CompareReport& report, std::size_t to) {
  const ComparedDiagnosis &a = report.diagnoses[to - 1], &b = report.diagnoses[to];
  const auto add = [&](Change::Kind kind, const std::string& text) {
    report.changes.push_back({kind, to, text});
  };
  if (a.verdict != b.verdict)
    add(Change::Kind::verdict, "verdict: " + with_spaces(a.verdict) + " -> " + with_spaces(b.verdict));
  const Eigen::Index n = std::max(a.rms.size(), b.rms.size());
  for (const EffectRow& row : report.effects) {
    const auto &before = row.in[to - 1], &after = row.in[to];
    if (!before && after)
      add(Change::Kind::appeared, "new: " + with_spaces(row.name) + joints_of(*after, n));
    else if (before && !after)
      add(Change::Kind::gone, "gone: " + with_spaces(row.name) + joints_of(*before, n));
    else if (before && after) {
      if (before->joints != after->joints)
        add(Change::Kind::changed,
            with_spaces(row.name) + ":" + joints_of(*after, n) + ", was" + joints_of(*before, n));
      else if (const std::string text = parameter_change(*before, *after, n); !text.empty())
        add(Change::Kind::changed, with_spaces(row.name) + joints_of(*after, n) + ": " + text);
    }
  }
  for (Eigen::Index j = 0; j < std::min(a.rms.size(), b.rms.size()); ++j) {
    const double change = std::abs(b.rms[j] - a.rms[j]);
    if (change > std::max(a.floor[j], b.floor[j]) && change > least_change * std::max(a.rms[j], b.rms[j]))
      add(Change::Kind::gap, "gap of joint " + std::to_string(j + 1) + ": " + short_number(a.rms[j], 3) +
                                 " -> " + short_number(b.rms[j], 3) + " " +
                                 a.unit[static_cast<std::size_t>(j)] + " rms");
  }
}

}  // namespace

namespace detail {

ComparedDiagnosis compared(const CompareJob::Entry& entry) {
  const json x = json::parse(entry.json, nullptr, false);
  const std::string remedy = ": expected what dynid diagnose --json writes, ";
  if (x.is_discarded()) throw Error(entry.name + remedy + "which is JSON");
  if (!x.is_object() || x.value("format", json()) != "dynid-diagnosis-1")
    throw Error(entry.name + remedy + "with format: dynid-diagnosis-1");
  try {
    ComparedDiagnosis d;
    d.name = entry.name;
    d.verdict = x.at("verdict").get<std::string>();
    const json& gap = x.at("gap");
    d.rms = numbers(gap.at("rms"));
    d.floor = numbers(gap.at("floor"));
    d.unit = gap.at("unit").get<std::vector<std::string>>();
    if (d.floor.size() != d.rms.size() || static_cast<Eigen::Index>(d.unit.size()) != d.rms.size())
      throw Error(entry.name + ": gap: rms, floor and unit are not of as many joints");
    for (const json& effect : x.at("effects")) d.effects.push_back(effect_of(effect));
    if (!d.effects.empty()) d.shrink = number(x.at("shrink").at("fraction"));
    return d;
  } catch (const json::exception& error) {
    throw Error(entry.name + remedy + "whole: " + error.what());
  }
}

}  // namespace detail

void check_options(const CompareJob& job) {
  if (job.diagnoses.size() < 2)
    throw OptionError("diagnoses", std::to_string(job.diagnoses.size()) + " given: two or more are needed");
}

CompareReport run(const CompareJob& job, const Context& context) {
  check_options(job);
  CompareReport report;
  for (const CompareJob::Entry& entry : job.diagnoses) {
    context.check();
    report.diagnoses.push_back(detail::compared(entry));
    for (const ComparedDiagnosis& other : report.diagnoses) check_alike(other, report.diagnoses.back());
  }
  const std::size_t count = report.diagnoses.size();
  for (std::size_t k = 0; k < count; ++k)
    for (const ComparedEffect& effect : report.diagnoses[k].effects)
      row_for(report.effects, effect, k, count).in[k] = effect;
  for (std::size_t k = 1; k < count; ++k) find_changes(report, k);
  return report;
}

}  // namespace dynid
