// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/retrieval/retrieval.hpp"

namespace dynid {

void validate(const Bounds& bounds) {
  const std::string where = (bounds.source.empty() ? "bounds" : bounds.source) + ": ";
  const auto fail = [&](const std::string& rule) { throw Error(where + rule); };
  const Eigen::VectorXd &low = bounds.lower, &high = bounds.upper;
  if (low.size() == 0 || low.size() % 10 != 0 || low.size() != high.size())
    fail("ten lower and ten upper bounds a link are needed");
  double low_sum = 0.0, high_sum = 0.0;
  for (int i = 0; i < low.size(); ++i) {
    const std::string name = variable_name(i);
    if (!std::isfinite(low[i]) || !std::isfinite(high[i])) fail("the bounds of " + name + " are not finite");
    if (low[i] > high[i])
      fail("the bounds of " + name + " cross: lower " + short_number(low[i]) + " > upper " +
           short_number(high[i]));
    if (i % 10 != 0) continue;
    if (low[i] < 0.0)
      fail("the lower bound of " + name + " is negative: " + short_number(low[i]) + " kg, eq. (11)");
    if (!(high[i] > 0.0)) fail("the upper bound of " + name + " leaves no mass, eq. (11)");
    low_sum += low[i];
    high_sum += high[i];
  }
  if (!(bounds.total_mass_lower <= bounds.total_mass_upper))
    fail("the bounds of the total mass cross: lower " + short_number(bounds.total_mass_lower) + " > upper " +
         short_number(bounds.total_mass_upper) + " kg");
  if (low_sum > bounds.total_mass_upper)
    fail("the smallest masses add up to " + short_number(low_sum) + " kg, above the largest total mass, " +
         short_number(bounds.total_mass_upper) + " kg, eq. (30)");
  if (high_sum < bounds.total_mass_lower)
    fail("the largest masses add up to " + short_number(high_sum) + " kg, below the smallest total mass, " +
         short_number(bounds.total_mass_lower) + " kg, eq. (30)");
  for (int i = 0; i < low.size(); i += 10) {
    const std::string link = "link " + std::to_string(i / 10 + 1) + ": ";
    const std::array<int, 3> moments = {i + 4, i + 6, i + 9};   // xx, yy, zz
    const std::array<int, 3> products = {i + 8, i + 7, i + 5};  // yz, xz, xy: across from the moments
    double trace = 0.0;
    for (const int k : moments) trace += high[k];
    for (std::size_t a = 0; a < 3; ++a) {
      const int k = moments[a];
      if (!(high[k] > 0.0))
        fail(link + "the upper bound of " + variable_name(k) + " is not positive, eq. (12)");
      if (low[k] > trace - high[k])
        fail(link + "the lower bound of " + variable_name(k) +
             " exceeds the sum of the other two moments' upper bounds, eq. (16)");
      const int product = products[a];
      if (std::max(low[product], -high[product]) > 0.5 * high[k])
        fail(link + "the bounds of " + variable_name(product) + " ask for more than half of the largest " +
             variable_name(k) + ", eq. (16)");
    }
    // s^T Sigma s >= 0 for every choice of signs s bounds a signed sum of the products by a quarter of the
    // trace... of I.
    for (const auto& signs : {std::array<double, 3>{1, 1, 1}, {-1, -1, 1}, {-1, 1, -1}, {1, -1, -1}}) {
      double least = 0.0;
      for (std::size_t a = 0; a < 3; ++a)
        least += std::min(signs[a] * low[products[a]], signs[a] * high[products[a]]);
      if (4.0 * least > trace)
        fail(link + "the products of inertia are asked to be larger than the moments allow, eq. (16)");
    }
  }
  for (const Constraint& constraint : bounds.constraints) {
    if (constraint.alternatives.empty()) fail("constraint '" + constraint.name + "' is empty");
    for (const Alternative& alternative : constraint.alternatives)
      for (const std::vector<Inequality>* list : {&alternative.guards, &alternative.required})
        for (const Inequality& h : *list) {
          if (!h.value) fail("constraint '" + constraint.name + "' has no value");
          for (const int index : h.variables)
            if (index < 0 || index >= low.size())
              fail("constraint '" + constraint.name + "' reads a parameter that is not there");
        }
  }
}

void validate(const RetrievalProblem& problem) {
  validate(problem.bounds);
  if (problem.objective.parameters() != problem.bounds.lower.size())
    throw Error((problem.bounds.source.empty() ? "bounds" : problem.bounds.source) + ": " +
                std::to_string(problem.bounds.links()) + " links are bounded, the model has " +
                std::to_string(problem.objective.parameters() / 10));
  if (!problem.prior) return;
  const Prior& prior = *problem.prior;
  if (static_cast<int>(prior.links.size()) != problem.bounds.links())
    throw Error("prior: " + std::to_string(prior.links.size()) + " links, the bounds have " +
                std::to_string(problem.bounds.links()));
  if (prior.scale.size() != 0 && prior.scale.size() != problem.bounds.lower.size())
    throw Error("prior: ten scales a link are needed");
  for (std::size_t i = 0; i < prior.links.size(); ++i) {
    const ConsistencyMargins margins = consistency_margins(prior.links[i]);
    if (!(margins.mass > 0.0) || (prior.distance == PriorDistance::entropic && !(margins.triangle > 0.0)))
      throw Error("prior: link " + std::to_string(i + 1) +
                  " is not physically consistent, eqs. (11) and (16)");
  }
}

}  // namespace dynid
