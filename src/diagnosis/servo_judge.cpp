// SPDX-License-Identifier: Apache-2.0
#include "servo_judge.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "identification/servo_run.hpp"

namespace dynid::detail {
namespace {

constexpr int final_iterations = 30;

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

/// A fit with another effect in the place of one, and what rows that fit and rows that judge say for it.
struct Replaced {
  int effect = 0;
  KnobFit fit;
  double difference = 0.0;  ///< log evidence, less that of the set as it is
};

/// Log evidence of the judging rows for `other` against `fit`, neither of which has seen them.
double predicted(const std::vector<double>& fit, const std::vector<double>& other, double floor,
                 double samples) {
  if (fit.empty()) return 0.0;
  const auto size = [&](const std::vector<double>& losses) {
    double sum = 0.0;
    for (const double loss : losses) sum += loss;
    return 2.0 * sum / double(losses.size()) + floor * floor;
  };
  return 0.5 * samples * std::log(size(fit) / size(other));
}

/// The rivals of effect `k` that the search could not rule out, on all rows.
std::vector<Replaced> replacements(const ServoAnswer& a, std::size_t k, const std::vector<double>& with,
                                   double held_samples, const ServoCriteria& criteria) {
  constexpr std::size_t most = 3;  // looked at again
  const ServoProblemOfJoint& p = a.problem;
  std::vector<std::pair<double, std::string>> rivals = weighed(a, a.effects[k]).rivals;
  std::sort(rivals.begin(), rivals.end(), std::greater<>());
  std::vector<int> others = a.effects;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
  const double own = log_evidence(p, a.fit, a.samples) - price_of(a.effects[k], a.samples);
  std::vector<Replaced> out;
  for (std::size_t r = 0; r < rivals.size() && out.size() < most; ++r) {
    if (rivals[r].first < -criteria.ruled_out) break;
    Replaced other;
    for (std::size_t e = 0; e < servo_effects().size(); ++e)
      if (rivals[r].second == servo_effects()[e].name) other.effect = static_cast<int>(e);
    std::vector<int> set = others;
    set.push_back(other.effect);
    other.fit = fit_from(p, starts_of(effect_of(other.effect), only(p.nominal, a.fit.x, others), p.scale),
                         freed(set), RowSet::fit, a.fit.width, a.samples, final_iterations);
    if (!possible(effect_of(other.effect), other.fit.x, p.nominal, p.scale)) continue;
    other.difference =
        log_evidence(p, other.fit, a.samples) - price_of(other.effect, a.samples) - own +
        predicted(with, judging_losses(p, other.fit, a.fit.width, a.samples), p.floor, held_samples);
    out.push_back(other);
  }
  return out;
}

/// Puts a rival in the place of effect `k`.
void replace(ServoAnswer& a, std::size_t k, const Replaced& by) {
  const std::string old = effect_of(a.effects[k]).name, name = effect_of(by.effect).name;
  for (WeighedServoEffect& w : a.choice.effects) {
    if (w.effect != a.effects[k]) continue;
    w.effect = by.effect;
    for (auto& [difference, rival] : w.rivals) {
      if (rival == name) rival = old, difference = 0.0;
      difference -= by.difference;
    }
  }
  a.effects[k] = by.effect;
  a.fit = by.fit;
}

}  // namespace

const WeighedServoEffect& weighed(const ServoAnswer& a, int effect) {
  return *std::find_if(a.choice.effects.begin(), a.choice.effects.end(),
                       [&](const WeighedServoEffect& w) { return w.effect == effect; });
}

Knobs only(const Knobs& nominal, const Knobs& x, const std::vector<int>& effects) {
  Knobs out = nominal;
  for (const Knob k : freed(effects)) out[at(k)] = x[at(k)];
  return out;
}

double probability_of(double gain, const std::vector<std::pair<double, std::string>>& rivals) {
  double others = std::exp(-gain);
  for (const auto& [difference, name] : rivals) others += std::exp(std::min(0.0, difference));
  return 1.0 / (1.0 + others);
}

std::vector<double> judging_losses(const ServoProblemOfJoint& p, const KnobFit& fit, double width,
                                   double samples) {
  const double unlikely = 1.0 + 2.0 * fit.penalty / samples;
  std::vector<double> out;
  for (const ServoRows& rows : p.rows) {
    const bool judges = std::find(rows.fit.begin(), rows.fit.end(), 0) != rows.fit.end();
    if (!judges) continue;
    const Eigen::VectorXd q = servo_motion(p, fit.x, rows);
    for (Eigen::Index i = 1; i < q.size(); ++i) {
      if (rows.fit[static_cast<std::size_t>(i)]) continue;
      out.push_back(unlikely * huber(q[i] - rows.series.q[i], width));
    }
  }
  return out;
}

double borne_out(const std::vector<double>& less, const std::vector<double>& more, double samples) {
  const std::size_t n = less.size();
  if (n < 2) return 0.5;
  const auto blocks = static_cast<std::size_t>(std::clamp(samples, 4.0, 60.0));
  std::vector<double> means;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t first = n * b / blocks, last = n * (b + 1) / blocks;
    if (last == first) continue;
    double sum = 0.0;
    for (std::size_t i = first; i < last; ++i) sum += less[i] - more[i];
    means.push_back(sum / double(last - first));
  }
  double mean = 0.0, squares = 0.0;
  for (const double m : means) mean += m;
  mean /= double(means.size());
  for (const double m : means) squares += (m - mean) * (m - mean);
  const double error = std::sqrt(squares / double(means.size() * (means.size() - 1)));
  if (!(error > 0.0)) return mean > 0.0 ? 1.0 : 0.5;
  return normal_cdf(mean / error);
}

void judge_servo(ServoAnswer& a, const ServoCriteria& criteria) {
  const ServoProblemOfJoint& p = a.problem;
  a.effects.clear();
  for (const WeighedServoEffect& w : a.choice.effects) a.effects.push_back(w.effect);
  const auto refit = [&](const std::vector<int>& effects, const Knobs& start) {
    return fit_knobs(p, start, freed(effects), RowSet::fit, servo_width(p, a.choice.fit.x), a.choice.samples,
                     final_iterations);
  };
  a.fit = refit(a.effects, a.choice.fit.x);
  a.samples = independent_samples(p, a.fit.x);
  double held = 0.0, all = 0.0;
  for (const ServoRows& rows : p.rows)
    for (const char fits : rows.fit) all += 1.0, held += fits ? 0.0 : 1.0;
  const double held_samples = a.samples * held / std::max(1.0, all - held);
  a.probability.assign(a.effects.size(), 0.0);
  a.aliases.assign(a.effects.size(), {});
  std::size_t replaced = 0;
  for (bool again = true; again && !a.effects.empty();) {
    again = false;
    const std::vector<double> with = judging_losses(p, a.fit, a.fit.width, a.samples);
    std::size_t worst = 0;
    std::vector<double> of_class;
    for (std::size_t k = 0; k < a.effects.size() && !again; ++k) {
      WeighedServoEffect w = weighed(a, a.effects[k]);
      for (const Replaced& other : replacements(a, k, with, held_samples, criteria)) {
        if (other.difference > criteria.replaces && replaced < a.effects.size()) {
          replace(a, k, other);
          ++replaced;
          again = true;
          break;
        }
        for (auto& [difference, rival] : w.rivals)
          if (rival == effect_of(other.effect).name) difference = other.difference;
      }
      if (again) break;
      std::vector<int> others = a.effects;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const KnobFit without = refit(others, only(p.nominal, a.fit.x, others));
      // On every row, in finer steps than the search takes.
      const double gain =
          std::min(w.gain, log_evidence(p, a.fit, a.samples) - log_evidence(p, without, a.samples) -
                               price_of(a.effects[k], a.samples));
      // Data that do not show an effect say nothing against it: only those that are worse with it do.
      const double held_out =
          with.empty() ? 1.0
                       : std::min(1.0, 2.0 * borne_out(judging_losses(p, without, a.fit.width, a.samples),
                                                       with, held_samples));
      a.probability[k] = std::min(probability_of(gain, w.rivals), held_out);
      // Which of two that look alike is open; that one of them is there need not be.
      std::vector<std::pair<double, std::string>> unlike;
      for (const auto& rival : w.rivals)
        if (rival.first <= -criteria.indistinct) unlike.push_back(rival);
      of_class.push_back(std::min(probability_of(gain, unlike), held_out));
      std::vector<std::string> aliases;
      for (const char* name : effect_of(a.effects[k]).aliases) aliases.emplace_back(name);
      for (const auto& [difference, name] : w.rivals)
        if (difference > -criteria.indistinct && name != effect_of(a.effects[k]).name &&
            std::find(aliases.begin(), aliases.end(), name) == aliases.end())
          aliases.push_back(name);
      a.aliases[k] = aliases;
      if (of_class[k] < of_class[worst]) worst = k;
    }
    if (again) continue;
    if (of_class[worst] < criteria.least_probability) {
      a.effects.erase(a.effects.begin() + static_cast<std::ptrdiff_t>(worst));
      a.probability.erase(a.probability.begin() + static_cast<std::ptrdiff_t>(worst));
      a.aliases.erase(a.aliases.begin() + static_cast<std::ptrdiff_t>(worst));
      a.fit = refit(a.effects, only(p.nominal, a.fit.x, a.effects));
      again = true;
    }
  }
  if (a.within_tolerance || std::sqrt(2.0 * a.fit.loss) > criteria.form_error * p.floor)
    for (double& probability : a.probability) probability = std::min(probability, criteria.most_probable);
}

}  // namespace dynid::detail
