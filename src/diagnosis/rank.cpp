// SPDX-License-Identifier: Apache-2.0
#include "rank.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "dynid/diagnosis/calibration.hpp"

namespace dynid::detail {

std::vector<std::size_t> by_share(const std::vector<double>& shares) {
  std::vector<std::size_t> order(shares.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return shares[a] > shares[b]; });
  return order;
}

Ranked rank(const Choice& choice, const Judged& judged, const std::vector<const Hypothesis*>& library) {
  const GapModel& model = judged.model;
  const double temperature = calibration().temperature;
  // Not only the others compared may be right instead, but none of them.
  const double sure =
      1.0 - std::min(0.99, calibration().doubt + calibration().doubt_of_rest * (1.0 - judged.explained));
  Ranked out{std::vector<double>(model.effects.size()),
             std::vector<std::vector<std::string>>(model.effects.size()),
             {}};
  std::map<std::string, double> first;
  const std::vector<std::size_t> order = by_share(judged.shares);
  for (const std::size_t k : order) {
    const std::string& mine = model.effects[k].h->name();
    const GapModel base = choice.search.evaluate(without(model.effects, k), model.kappa);
    std::map<std::string, double> scores = {{mine, model.score}};
    for (const GapModel& m : choice.search.alternatives(base, 8)) {
      const std::string name = m.effects.back().h->name();
      double& best = scores.emplace(name, m.score).first->second;
      best = std::max(best, m.score);
      if (name != mine && m.fit.total > model.fit.total - choice.criteria().indistinct)
        out.aliases[k].push_back(name);
    }
    double sum = 0.0;
    for (const auto& [name, s] : scores) sum += std::exp((s - model.score) / temperature);
    out.probability[k] = sure / sum;
    if (k == order.front())
      for (const auto& [name, s] : scores)
        first[name] = sure * std::exp((s - model.score) / temperature) / sum;
  }
  for (const Hypothesis* h : library) first.emplace(h->name(), 0.0);
  for (const auto& [name, probability] : first) out.ranking.push_back({name, probability});
  std::stable_sort(out.ranking.begin(), out.ranking.end(), [](const RankedEffect& a, const RankedEffect& b) {
    return a.probability > b.probability;
  });
  return out;
}

}  // namespace dynid::detail
