// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/yaml.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/statistics.hpp"

namespace dynid {

namespace detail {
extern const char* const calibration_in_use;  // made by CMake from config/diagnosis_calibration.yaml
}

namespace {

constexpr double interval = 0.9;  // of the cases that an interval is to hold, each of weight one
constexpr std::size_t least_cases = 30, none = std::size_t(-1);
// What no library has is rarer in a bank than on robots.
constexpr double weight_of_unknown = 2.0;
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

/// An effect that was weighed: its grounds, and whether it was there.
struct Weighed {
  std::string name;
  Grounds grounds;
  bool right;
  double weight;
};

/// Every effect weighed in the bank, but those that may be there or not. What the weights are to say is how
/// likely it is that the effect is there, or one that was named beside it as not to be told from it.
std::vector<Weighed> weighed(const std::vector<BlindCase>& cases) {
  std::vector<Weighed> out;
  const auto there = [](const BlindCase& c, const std::string& name) {
    return std::any_of(c.truth.begin(), c.truth.end(), [&](const Effect& t) { return t.name == name; });
  };
  for (const BlindCase& c : cases) {
    if (!c.failure.empty()) continue;
    const bool unknown =
        !c.withheld.empty() || std::any_of(c.truth.begin(), c.truth.end(),
                                           [](const Effect& t) { return t.name.rfind("unknown", 0) == 0; });
    for (const ConsideredEffect& e : c.considered) {
      if (std::find(c.background.begin(), c.background.end(), e.name) != c.background.end()) continue;
      bool right = there(c, e.name);
      for (const FoundEffect& f : c.found)
        for (const std::string& alias : f.aliases)
          right = right || (f.effect.name == e.name && there(c, alias));
      out.push_back({e.name, e.grounds, right, unknown ? weight_of_unknown : 1.0});
    }
  }
  return out;
}

/// Logistic regression by Newton steps: the weight of 1 free, those of the grounds with a normal prior of
/// variance 1/3 on grounds of unit spread, those of names with one of 1/2: what predicts cases left out best.
void fit_weights(const std::vector<Weighed>& all, Calibration& c) {
  constexpr int steps = 30;
  constexpr auto grounds = static_cast<Eigen::Index>(ground_count);
  std::map<std::string, Eigen::Index> names;
  for (const Weighed& w : all) names.emplace(w.name, 0);
  Eigen::Index size = grounds;
  for (auto& [name, column] : names) column = size++;
  const Eigen::Index one = size++, rows = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(rows, size);
  Eigen::VectorXd right(rows), weight(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Weighed& w = all[static_cast<std::size_t>(i)];
    X.row(i).head(grounds) = Eigen::Map<const Eigen::RowVectorXd>(w.grounds.value.data(), grounds);
    X(i, names.at(w.name)) = X(i, one) = 1.0;
    right[i] = w.right ? 1.0 : 0.0;
    weight[i] = w.weight;
  }
  const Eigen::RowVectorXd mean = X.leftCols(grounds).colwise().mean();
  const Eigen::RowVectorXd spread =
      ((X.leftCols(grounds).rowwise() - mean).colwise().squaredNorm() / double(rows))
          .cwiseSqrt()
          .cwiseMax(1e-6);
  X.leftCols(grounds) = (X.leftCols(grounds).rowwise() - mean).array().rowwise() / spread.array();
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(size, 2.0), w = Eigen::VectorXd::Zero(size);
  prior.head(grounds).setConstant(3.0);
  prior[one] = 1e-3;
  for (int k = 0; k < steps; ++k) {
    const Eigen::VectorXd p = (1.0 + (-(X * w).array()).exp()).inverse();
    const Eigen::VectorXd slope = X.transpose() * weight.cwiseProduct(right - p) - prior.cwiseProduct(w);
    Eigen::MatrixXd H =
        X.transpose() * (weight.array() * p.array() * (1.0 - p.array())).matrix().asDiagonal() * X;
    H.diagonal() += prior;
    w += H.ldlt().solve(slope);
  }
  c.weight_of_one = w[one];
  for (Eigen::Index k = 0; k < grounds; ++k) {
    c.weights.value[static_cast<std::size_t>(k)] = w[k] / spread[k];
    c.weight_of_one -= w[k] * mean[k] / spread[k];
  }
  c.weight_of_name.clear();
  for (const auto& [name, column] : names) c.weight_of_name[name] = w[column];
}

/// What the arms and logs of a bank over the family were.
std::map<std::string, std::pair<double, double>> family_of(const std::vector<BlindCase>& cases) {
  std::map<std::string, std::pair<double, double>> out;
  for (const auto& [drawn, key] : {std::pair{"joints", "joints"}, std::pair{"rate", "rate_hz"},
                                   std::pair{"duration", "duration_s"}, std::pair{"logs", "logs"}}) {
    for (const BlindCase& c : cases) {
      const auto found = c.drawn.find(drawn);
      if (found == c.drawn.end()) continue;
      const double value = std::stod(found->second);
      const auto range = out.emplace(key, std::pair{value, value}).first;
      range->second.first = std::min(range->second.first, value);
      range->second.second = std::max(range->second.second, value);
    }
  }
  return out;
}

}  // namespace

Calibration parse_calibration(const std::string& text, const std::string& name) {
  const detail::YamlItem file =
      detail::YamlItem::document(text, name, "dynid-calibration-1", "a calibration");
  file.expect_keys({"format", "temperature", "weight_of_one", "weights", "weight_of_name", "interval_factor",
                    "interval_factor_off", "form_error", "form_errors", "family"});
  Calibration c;
  c.temperature = file.at("temperature").positive_number();
  c.weight_of_one = file.at("weight_of_one").number();
  const detail::YamlItem weights = file.at("weights");
  weights.expect_keys({ground_names.begin(), ground_names.end()});
  for (std::size_t k = 0; k < ground_count; ++k) c.weights.value[k] = weights.at(ground_names[k]).number();
  for (const auto& [effect, weight] : file.at("weight_of_name").entries())
    c.weight_of_name[effect] = weight.number();
  c.interval_factor = file.at("interval_factor").positive_number();
  c.interval_factor_off = file.at("interval_factor_off").positive_number();
  c.form_error = file.at("form_error").number();
  for (const auto& [parameter, error] : file.at("form_errors").entries())
    c.form_errors[parameter] = error.number();
  const detail::YamlItem family = file.at("family");
  family.expect_keys({"joints", "rate_hz", "duration_s", "logs"});
  for (const auto& [key, range] : family.entries()) {
    const Eigen::Vector2d ends = range.vector<2>();
    if (!(ends[0] <= ends[1])) range.fail("from and to: the first must not be above the second");
    c.family[key] = {ends[0], ends[1]};
  }
  return c;
}

Calibration read_calibration(const std::string& path) { return parse_calibration(read_file(path), path); }

const Calibration& calibration() {
  static const Calibration inside =
      parse_calibration(detail::calibration_in_use, "config/diagnosis_calibration.yaml");
  return inside;
}

std::vector<std::string> outside_family(const Calibration& calibration, const std::vector<Log>& logs) {
  std::vector<std::string> out;
  const auto look = [&](const char* key, const std::string& what, double value) {
    const auto range = calibration.family.find(key);
    if (range == calibration.family.end()) return;
    const auto& [low, high] = range->second;
    constexpr double room = 1.05;  // rates and lengths are seldom what they are called
    if (value * room < low || value > room * high)
      out.push_back(what + " (" + short_number(value, 3) + ", there " + short_number(low, 3) + " to " +
                    short_number(high, 3) + ")");
  };
  look("joints", "the number of joints", double(logs.front().joints()));
  look("logs", "the number of logs", double(logs.size()));
  double shortest = std::numeric_limits<double>::infinity(), longest = 0.0, slowest = shortest,
         quickest = 0.0;
  for (const Log& log : logs) {
    const double duration = log.t[log.samples() - 1] - log.t[0],
                 rate = double(log.samples() - 1) / std::max(duration, 1e-9);
    shortest = std::min(shortest, duration), longest = std::max(longest, duration);
    slowest = std::min(slowest, rate), quickest = std::max(quickest, rate);
  }
  look("duration_s", "the shortest log's length [s]", shortest);
  if (longest > shortest) look("duration_s", "the longest log's length [s]", longest);
  look("rate_hz", "the slowest log's rate [Hz]", slowest);
  if (quickest > slowest) look("rate_hz", "the quickest log's rate [Hz]", quickest);
  return out;
}

double Calibration::probability(const std::string& name, const Grounds& grounds) const {
  const auto own = weight_of_name.find(name);
  double sum = weight_of_one + (own != weight_of_name.end() ? own->second : 0.0);
  for (std::size_t k = 0; k < ground_count; ++k) sum += weights.value[k] * grounds.value[k];
  return 1.0 / (1.0 + std::exp(-sum));
}

Calibration fit_calibration(const std::vector<BlindCase>& cases) {
  const Calibration& old = calibration();
  std::vector<Error90> errors;
  std::size_t named = 0;
  for (const BlindCase& c : cases) {
    if (!c.failure.empty() || c.found.empty() || c.truth.empty()) continue;
    ++named;
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
                        1.0 / double(alike), named});
    }
  }
  const std::vector<Weighed> all_weighed = weighed(cases);
  if (all_weighed.size() < least_cases)
    throw Error("calibration: " + std::to_string(all_weighed.size()) + " effects were weighed, " +
                std::to_string(least_cases) + " are needed");
  Calibration best = old;
  fit_weights(all_weighed, best);
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
  best.family = family_of(cases);
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
      << "temperature: " << c.temperature << "\nweight_of_one: " << c.weight_of_one << "\nweights:\n";
  for (std::size_t k = 0; k < ground_count; ++k)
    out << "  " << ground_names[k] << ": " << c.weights.value[k] << "\n";
  out << "weight_of_name:\n";
  for (const auto& [name, weight] : c.weight_of_name) out << "  " << name << ": " << weight << "\n";
  out << "interval_factor: " << c.interval_factor << "\ninterval_factor_off: " << c.interval_factor_off
      << "\nform_error: " << c.form_error << "\nform_errors:\n";
  for (const auto& [parameter, error] : c.form_errors) out << "  " << parameter << ": " << error << "\n";
  out << "family:" << (c.family.empty() ? " {}\n" : "\n");
  for (const auto& [key, range] : c.family)
    out << "  " << key << ": [" << range.first << ", " << range.second << "]\n";
  return out.str();
}

}  // namespace dynid
