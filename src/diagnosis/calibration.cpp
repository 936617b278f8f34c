// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/yaml.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"

namespace dynid {

namespace detail {
extern const char* const calibration_in_use;  // made by CMake from config/diagnosis_calibration.yaml
}

namespace {

constexpr double interval = 0.9;  // of the cases that an interval is to hold, each of weight one
constexpr std::size_t least_cases = 30, none = std::size_t(-1);
constexpr double step_of_factor = 1.05, largest_factor = 6.0;

/// One parameter's error, and half its interval before any factor.
struct Error90 {
  std::string parameter;  // "effect.parameter"
  bool off;               // the nominal model is
  double error, half, scale, weight;
  std::size_t of_case;
};

/// What an error is beyond the factor's part of its interval, in units of its scale.
double beyond(const Error90& e, const Calibration& c) {
  const double half = (e.off ? c.interval_factor_off : c.interval_factor) * e.half;
  return std::sqrt(std::max(0.0, e.error * e.error - half * half)) / e.scale;
}

/// Form errors of each parameter from all cases but one (or of all, where it is none of them).
std::map<std::string, double> form_errors(const std::vector<Error90>& errors, const Calibration& c,
                                          std::size_t but) {
  std::map<std::string, std::vector<WeightedSample>> seen;
  for (const Error90& e : errors)
    if (e.of_case != but) seen[e.parameter].push_back({beyond(e, c), e.weight});
  std::map<std::string, double> out;
  for (const auto& [parameter, x] : seen) out[parameter] = quantile(x, interval);
  return out;
}

/// Part of the intervals with the nominal model right, or off, that hold the truth of a case left out.
double left_out_coverage(const std::vector<Error90>& errors, const Calibration& c, bool off) {
  int covered = 0, all = 0;
  std::map<std::string, double> forms;
  std::size_t left_out = none;
  for (const Error90& e : errors) {  // those of one case are together
    if (e.off != off) continue;
    if (e.of_case != left_out) forms = form_errors(errors, c, left_out = e.of_case);
    const auto form = forms.find(e.parameter);
    if (form == forms.end()) continue;
    ++all;
    if (beyond(e, c) <= form->second) ++covered;
  }
  return all > 0 ? double(covered) / all : 1.0;
}

/// One case's first effect: was it right, and what the ranking and the rest of the gap say of it.
struct Named {
  bool right = false;
  double unexplained = 0.0;
  std::vector<double> behind;  // of the others: score less that of the first
};

double probability(const Named& n, double temperature, double doubt, double doubt_of_rest) {
  double sum = 1.0;
  for (const double score : n.behind) sum += std::exp(score / temperature);
  return (1.0 - std::min(0.99, doubt + doubt_of_rest * n.unexplained)) / sum;
}

}  // namespace

const Calibration& calibration() {
  static const Calibration inside = [] {
    const detail::YamlItem file =
        detail::YamlItem::document(detail::calibration_in_use, "config/diagnosis_calibration.yaml",
                                   "dynid-calibration-1", "a calibration");
    file.expect_keys({"format", "temperature", "doubt", "doubt_of_rest", "interval_factor",
                      "interval_factor_off", "form_error", "form_errors"});
    Calibration c;
    c.temperature = file.at("temperature").positive_number();
    c.doubt = file.at("doubt").number();
    c.doubt_of_rest = file.at("doubt_of_rest").number();
    c.interval_factor = file.at("interval_factor").positive_number();
    c.interval_factor_off = file.at("interval_factor_off").positive_number();
    c.form_error = file.at("form_error").number();
    for (const auto& [parameter, error] : file.at("form_errors").entries())
      c.form_errors[parameter] = error.number();
    return c;
  }();
  return inside;
}

Calibration fit_calibration(const std::vector<BlindCase>& cases) {
  const Calibration& old = calibration();
  std::vector<Named> named;
  std::vector<Error90> errors;
  for (const BlindCase& c : cases) {
    if (!c.failure.empty() || c.found.empty() || c.truth.empty()) continue;
    Named n;
    n.right = std::any_of(c.truth.begin(), c.truth.end(),
                          [&](const Effect& e) { return e.name == c.found.front().effect.name; });
    n.unexplained = 1.0 - c.explained;
    const auto first = std::find_if(c.ranking.begin(), c.ranking.end(),
                                    [&](const auto& r) { return r.first == c.found.front().effect.name; });
    for (auto r = c.ranking.begin(); first != c.ranking.end() && r != c.ranking.end(); ++r)
      if (r != first && r->second > 0.0)
        n.behind.push_back(old.temperature * std::log(r->second / first->second));
    named.push_back(std::move(n));
    const std::vector<ComparedInterval> intervals = compared_intervals(c);
    for (const ComparedInterval& i : intervals) {
      if (i.scale == 0.0) continue;  // of no size: nothing to be relative to
      const auto alike =
          std::count_if(intervals.begin(), intervals.end(),
                        [&](const ComparedInterval& other) { return other.parameter == i.parameter; });
      const std::string& effect = c.found.front().effect.name;
      const bool off = c.nominal_error > 0.0;
      const double half = i.truth > i.value ? i.high - i.value : i.value - i.low;
      const double form = old.form_error_of(effect, i.parameter) * i.scale;
      const double plain = std::sqrt(std::max(0.0, half * half - form * form));
      errors.push_back({effect + "." + i.parameter, off, std::abs(i.truth - i.value),
                        plain / (off ? old.interval_factor_off : old.interval_factor), i.scale,
                        1.0 / double(alike), named.size()});
    }
  }
  if (named.size() < least_cases)
    throw Error("calibration: " + std::to_string(named.size()) + " cases with an effect named, " +
                std::to_string(least_cases) + " are needed");
  Calibration best = old;
  double most = -1e300;
  for (double temperature = 1.0; temperature <= 16.0; temperature *= std::sqrt(2.0)) {
    for (const double doubt : {0.002, 0.005, 0.01, 0.02, 0.04}) {
      for (const double rest : {0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0}) {
        double likelihood = 0.0;
        for (const Named& n : named) {
          const double p = std::clamp(probability(n, temperature, doubt, rest), 1e-6, 1.0 - 1e-6);
          likelihood += std::log(n.right ? p : 1.0 - p);
        }
        if (likelihood > most) {
          most = likelihood;
          best.temperature = temperature;
          best.doubt = doubt;
          best.doubt_of_rest = rest;
        }
      }
    }
  }
  // The least factors, not below 1, with which nine in ten hold; what each does to the other is little.
  best.interval_factor = best.interval_factor_off = 1.0;
  for (int turn = 0; turn < 2; ++turn) {
    for (const bool off : {false, true}) {
      double& factor = off ? best.interval_factor_off : best.interval_factor;
      factor = 1.0;
      while (factor < largest_factor && left_out_coverage(errors, best, off) < interval)
        factor *= step_of_factor;
    }
  }
  best.form_errors = form_errors(errors, best, none);
  std::vector<WeightedSample> all;
  for (const Error90& e : errors) all.push_back({beyond(e, best), e.weight});
  if (!all.empty()) best.form_error = quantile(all, interval);
  return best;
}

std::string calibration_yaml(const Calibration& c, const std::string& command) {
  std::ostringstream out;
  out.precision(4);
  out << "# What makes the probabilities and intervals of a diagnosis mean what they say, see "
         "docs/diagnosis.md.\n"
      << "# Made by: " << command << "\n"
      << "format: dynid-calibration-1\n"
      << "temperature: " << c.temperature << "\ndoubt: " << c.doubt << "\ndoubt_of_rest: " << c.doubt_of_rest
      << "\ninterval_factor: " << c.interval_factor << "\ninterval_factor_off: " << c.interval_factor_off
      << "\nform_error: " << c.form_error << "\nform_errors:\n";
  for (const auto& [parameter, error] : c.form_errors) out << "  " << parameter << ": " << error << "\n";
  return out.str();
}

}  // namespace dynid
