// SPDX-License-Identifier: Apache-2.0
#include "global.hpp"

#include <nlopt.h>

#include <cmath>
#include <memory>
#include <vector>

namespace dynid::detail {

namespace {

struct Search {
  const Prepared& prepared;
  double xi;
  const std::atomic<bool>* stop;
  std::vector<int> free;  // parameters whose bounds differ
  Eigen::VectorXd p;      // the fixed ones stay
  Eigen::VectorXd best;
  double best_value;
  nlopt_opt opt = nullptr;

  /// f at `unit`, the free parameters as parts of their ranges.
  double operator()(const double* unit) {
    for (std::size_t k = 0; k < free.size(); ++k) {
      const int i = free[k];
      p[i] = prepared.bounds().lower[i] + unit[k] * (prepared.bounds().upper[i] - prepared.bounds().lower[i]);
    }
    const double value = prepared.f(p, xi);
    if (value < best_value) {
      best_value = value;
      best = p;
    }
    if (stop != nullptr && stop->load(std::memory_order_relaxed)) nlopt_force_stop(opt);
    return value;
  }
};

double evaluate(unsigned, const double* unit, double*, void* data) {
  return (*static_cast<Search*>(data))(unit);
}

nlopt_algorithm nlopt_name(GlobalAlgorithm algorithm) {
  switch (algorithm) {
    case GlobalAlgorithm::mlsl:
      return NLOPT_G_MLSL_LDS;
    case GlobalAlgorithm::isres:
      return NLOPT_GN_ISRES;
    case GlobalAlgorithm::esch:
      return NLOPT_GN_ESCH;
    case GlobalAlgorithm::direct_l:
      return NLOPT_GN_DIRECT_L_RAND;
    case GlobalAlgorithm::crs2:
    case GlobalAlgorithm::none:
      break;
  }
  return NLOPT_GN_CRS2_LM;
}

}  // namespace

Eigen::VectorXd solve_global(const Prepared& prepared, const Eigen::VectorXd& p, double xi,
                             GlobalAlgorithm algorithm, int evaluations, std::uint64_t seed,
                             const std::atomic<bool>* stop) {
  if (algorithm == GlobalAlgorithm::none || evaluations <= 0) return p;
  const Bounds& bounds = prepared.bounds();
  Search search{prepared, xi, stop, {}, p, p, prepared.f(p, xi)};
  std::vector<double> unit;
  for (int i = 0; i < prepared.size(); ++i) {
    const double range = bounds.upper[i] - bounds.lower[i];
    if (!(range > 0.0)) continue;
    search.free.push_back(i);
    unit.push_back(std::min(1.0, std::max(0.0, (p[i] - bounds.lower[i]) / range)));
  }
  if (unit.empty()) return p;
  const auto count = static_cast<unsigned>(unit.size());
  using Owned = std::unique_ptr<std::remove_pointer_t<nlopt_opt>, void (*)(nlopt_opt)>;
  const Owned opt(nlopt_create(nlopt_name(algorithm), count), nlopt_destroy);
  search.opt = opt.get();
  nlopt_set_min_objective(opt.get(), evaluate, &search);
  nlopt_set_lower_bounds1(opt.get(), 0.0);
  nlopt_set_upper_bounds1(opt.get(), 1.0);
  nlopt_set_maxeval(opt.get(), evaluations);
  if (algorithm == GlobalAlgorithm::mlsl) {
    const Owned local(nlopt_create(NLOPT_LN_SBPLX, count), nlopt_destroy);
    nlopt_set_maxeval(local.get(), evaluations / 4);
    nlopt_set_local_optimizer(opt.get(), local.get());
  }
  // NLopt's generator is one a thread: seeded here, the search does not depend on what ran before it.
  nlopt_srand(static_cast<unsigned long>(seed & 0xffffffffULL));
  double value = 0.0;
  nlopt_optimize(opt.get(), unit.data(), &value);  // the best point seen is kept whatever it returns
  return search.best;
}

}  // namespace dynid::detail
