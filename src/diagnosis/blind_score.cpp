// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "dynid/base/statistics.hpp"
#include "dynid/diagnosis/blind.hpp"
#include "dynid/diagnosis/calibration.hpp"

namespace dynid {
namespace {

/// The same angle, less than half a turn from `there`.
double turned_to(double there, double angle, double turn) {
  return angle + turn * std::round((there - angle) / turn);
}

/// A tilt by -a towards d is one by a towards d + 180: the truth in the words of the estimate.
double turned_positive(const Effect& tilt, const std::string& key, double estimate) {
  const double angle = tilt.parameters.at("angle_deg")[0];
  if (key == "angle_deg") return std::abs(angle);
  const double direction = tilt.parameters.at("direction_deg")[0] + (angle < 0.0 ? 180.0 : 0.0);
  return turned_to(estimate, direction, 360.0);
}

}  // namespace

std::vector<ComparedInterval> compared_intervals(const BlindCase& c) {
  std::vector<ComparedInterval> out;
  if (c.truth.size() != 1 || c.found.empty() || c.found.front().effect.name != c.truth.front().name ||
      !c.withheld.empty())
    return out;
  const Effect& e = c.truth.front();
  const FoundEffect& first = c.found.front();
  const auto has = [](const std::vector<int>& joints, int joint) {
    return std::find(joints.begin(), joints.end(), joint) != joints.end();
  };
  const auto link = first.effect.parameters.find("link"), true_link = e.parameters.find("link");
  if (link != first.effect.parameters.end() && true_link != e.parameters.end() &&
      link->second != true_link->second)
    return out;  // what belongs to another link is in another frame
  for (const ParameterEstimate& p : first.parameters) {
    if (p.key == "velocity_scale" && p.per_joint) continue;  // smooths a sign: nothing that a joint has
    const auto found = e.parameters.find(p.key);
    if (found == e.parameters.end() || found->second.size() != static_cast<std::size_t>(p.value.size()))
      continue;
    for (Eigen::Index i = 0; i < p.value.size(); ++i) {
      if (p.low[i] == p.high[i]) continue;  // chosen, not measured
      double truth = found->second[static_cast<std::size_t>(i)];
      if (e.name == "gravity_tilt") truth = turned_positive(e, p.key, p.value[i]);
      if (p.key == "phase") truth = turned_to(p.value[i], truth, 2.0 * M_PI);
      const int joint = static_cast<int>(i) + 1;
      if (truth == 0.0 || (p.per_joint && !(has(e.joints, joint) && has(first.effect.joints, joint))))
        continue;
      out.push_back({p.key, p.value[i], p.low[i], p.high[i], truth, Calibration::scale(p, i)});
    }
  }
  return out;
}

namespace {

bool names(const BlindCase& c, const std::string& name) {
  return std::any_of(c.found.begin(), c.found.end(),
                     [&](const FoundEffect& f) { return f.effect.name == name; });
}

bool is_there(const BlindCase& c, const std::string& name) {
  return std::any_of(c.truth.begin(), c.truth.end(), [&](const Effect& e) { return e.name == name; }) ||
         std::find(c.background.begin(), c.background.end(), name) != c.background.end();
}

/// Counts every effect named; whether one was at 0.9 or more.
bool score_all_named(const BlindCase& c, BlindScore& s, std::vector<double>& sums,
                     std::vector<double>& right) {
  bool confident = false;
  for (const FoundEffect& f : c.found) {
    const bool there = is_there(c, f.effect.name);
    ++s.named;
    const auto bin = static_cast<std::size_t>(std::clamp(f.probability * 10.0, 0.0, 9.0));
    sums[bin] += f.probability;
    right[bin] += there ? 1.0 : 0.0;
    if (f.probability >= 0.9) {
      confident = true;
      ++s.named_confident;
      if (!there) ++s.confident_not_there;
    } else if (f.probability >= 0.5) {
      ++s.named_likely;
      s.likely_claimed += f.probability;
      if (!there) ++s.likely_not_there;
    }
  }
  return confident;
}

void score_vendor(const BlindCase& c, BlindScore& s, std::vector<double>& friction_errors) {
  for (std::size_t k = 0; k < c.truth.size(); ++k) {
    const Effect& e = c.truth[k];
    const bool friction = e.name == "viscous_friction" || e.name == "coulomb_friction";
    const bool main = friction || e.name == "rotor_inertia";
    if (k < c.truth_shares.size() && c.truth_shares[k] >= (main ? 0.02 : 0.03)) {
      ++(main ? s.vendor_main : s.vendor_further);
      if (names(c, e.name)) ++(main ? s.vendor_main_named : s.vendor_further_named);
    }
    if (!friction) continue;
    for (const FoundEffect& f : c.found) {
      const auto found = f.effect.parameters.find("coefficient");
      if (f.effect.name != e.name || found == f.effect.parameters.end()) continue;
      const std::vector<double>& truth = e.parameters.at("coefficient");
      for (const int joint : f.effect.joints) {
        const auto j = static_cast<std::size_t>(joint - 1);
        if (j < truth.size() && j < found->second.size() && truth[j] > 0.0)
          friction_errors.push_back(std::abs(found->second[j] / truth[j] - 1.0));
      }
    }
  }
}

void score_attainable(const BlindCase& c, bool first_right, BlindScore& s) {
  // Once each: more than one link may be wrong.
  const std::set<std::string> attainable(c.attainable.begin(), c.attainable.end());
  int named = 0;
  for (const std::string& name : attainable) named += names(c, name) ? 1 : 0;
  const int all = static_cast<int>(attainable.size());
  s.attainable += all;
  s.attainable_named += named;
  if (all == 0) return;
  ++s.known_attainable;
  if (first_right) ++s.first_right_attainable;
  if (all != 2 || c.truth.size() != 2) return;
  ++s.pairs_attainable;
  if (named == all) ++s.both_found_attainable;
}

}  // namespace

std::map<std::string, double> further_figures(const BlindScore& s) {
  return {{"named", s.named},
          {"named_confident", s.named_confident},
          {"confident_not_there", s.confident_not_there},
          {"named_likely", s.named_likely},
          {"likely_not_there", s.likely_not_there},
          {"likely_claimed", s.likely_claimed},
          {"calibration_error_all", s.calibration_error_all},
          {"clean_verdicts", s.clean_verdicts},
          {"healthy_confident", s.healthy_confident},
          {"unknown_confident", s.unknown_confident},
          {"triples", s.triples},
          {"all_three_found", s.all_three_found},
          {"known_unexplained", s.known_unexplained},
          {"known_within", s.known_within},
          {"known_within_clean", s.known_within_clean},
          {"known_attainable", s.known_attainable},
          {"first_right_attainable", s.first_right_attainable},
          {"pairs_attainable", s.pairs_attainable},
          {"both_found_attainable", s.both_found_attainable},
          {"attainable", s.attainable},
          {"attainable_named", s.attainable_named},
          {"vendor_main", s.vendor_main},
          {"vendor_main_named", s.vendor_main_named},
          {"vendor_further", s.vendor_further},
          {"vendor_further_named", s.vendor_further_named},
          {"vendor_friction_error", s.vendor_friction_error}};
}

BlindScore score(const std::vector<BlindCase>& cases) {
  BlindScore s;
  std::vector<double> errors, shrinks, ratios, friction_errors;
  std::vector<double> bin_sum(10, 0.0), bin_right(10, 0.0), all_sum(10, 0.0), all_right(10, 0.0);
  int judged = 0;
  for (const BlindCase& c : cases) {
    if (!c.failure.empty()) {
      ++s.failures;
      continue;
    }
    ++s.cases;
    const bool confident = score_all_named(c, s, all_sum, all_right);
    if (c.vendor) score_vendor(c, s, friction_errors);
    const FoundEffect* first = c.found.empty() ? nullptr : &c.found.front();
    const std::string named = first == nullptr ? to_string(c.verdict) : first->effect.name;
    if (c.truth.empty()) {
      ++s.no_gap;
      if (c.verdict == Verdict::no_gap || c.verdict == Verdict::not_detected) ++s.clean_verdicts;
      if (confident) ++s.healthy_confident;
      ++s.confusion["(no gap)"][named];
      if (first != nullptr) {
        ++s.false_alarms;
        if (first->probability >= 0.9) ++s.confident_wrong;
      }
      continue;
    }
    const bool beyond = c.truth[0].name.rfind("unknown", 0) == 0 || !c.withheld.empty();
    if (beyond) {
      ++s.unknown;
      if (confident) ++s.unknown_confident;
      ++s.confusion["(" + (c.withheld.empty() ? c.truth[0].name : "withheld " + c.truth[0].name) + ")"]
                   [named];
      if (c.verdict == Verdict::unexplained) ++s.abstained;
      if (first != nullptr && first->probability >= 0.9) ++s.confident_wrong;
      continue;
    }
    ++s.known;
    if (c.verdict == Verdict::unexplained) ++s.known_unexplained;
    if (c.within_tolerance) {
      ++s.known_within;
      if (c.verdict == Verdict::no_gap || c.verdict == Verdict::not_detected) ++s.known_within_clean;
    }
    const auto is_true = [&](const std::string& name) {
      return std::any_of(c.truth.begin(), c.truth.end(), [&](const Effect& e) { return e.name == name; });
    };
    std::string truth = c.truth[0].name;
    if (first != nullptr && is_true(named)) truth = named;
    ++s.confusion[truth][named];
    const bool right = first != nullptr && is_true(named);
    bool in_class = right;
    if (first != nullptr)
      for (const std::string& alias : first->aliases) in_class = in_class || is_true(alias);
    s.first_right += right ? 1 : 0;
    s.class_right += in_class ? 1 : 0;
    if (c.truth.size() > 1 && !c.vendor) {
      std::size_t found = 0;
      for (const Effect& e : c.truth) found += names(c, e.name) ? 1 : 0;
      (c.truth.size() == 2 ? s.pairs : s.triples) += 1;
      if (found == c.truth.size()) ++(c.truth.size() == 2 ? s.both_found : s.all_three_found);
    }
    score_attainable(c, right, s);
    if (first != nullptr) {
      ++judged;
      const auto bin = static_cast<std::size_t>(std::clamp(first->probability * 10.0, 0.0, 9.0));
      bin_sum[bin] += first->probability;
      bin_right[bin] += right ? 1.0 : 0.0;
      if (!right && first->probability >= 0.9) ++s.confident_wrong;
    }
    if (right && c.truth.size() == 1 && c.truth.front().joints == first->effect.joints) ++s.joints_right;
    for (const ComparedInterval& i : compared_intervals(c)) {
      ++s.intervals;
      if (i.low <= i.truth && i.truth <= i.high) ++s.covered;
      errors.push_back(std::abs(i.value - i.truth) / std::abs(i.truth));
    }
    if (c.true_shrink > 0.2) ratios.push_back(std::max(0.0, c.shrink) / c.true_shrink);
    shrinks.push_back(c.shrink);
  }
  s.parameter_error = median(errors);
  s.shrink = median(shrinks);
  s.shrink_of_true = median(ratios);
  s.vendor_friction_error = median(friction_errors);
  for (std::size_t b = 0; b < 10; ++b)
    if (s.named > 0) s.calibration_error_all += std::abs(all_right[b] - all_sum[b]) / s.named;
  for (std::size_t b = 0; b < 10; ++b)
    if (judged > 0) s.calibration_error += std::abs(bin_right[b] - bin_sum[b]) / judged;
  return s;
}

}  // namespace dynid
