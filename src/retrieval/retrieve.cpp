// SPDX-License-Identifier: Apache-2.0
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/retrieval/retrieval.hpp"
#include "global.hpp"
#include "local.hpp"
#include "prior_distance.hpp"

namespace dynid {

namespace {

using detail::LocalSolution;
using detail::LocalTask;
using detail::Prepared;

/// Runs are made in waves of this many where they may end early: the same whatever the threads and ranks.
constexpr int wave = 8;
constexpr double agreement = 1e-4;
/// A solution whose objective is larger by this part is as good: see RetrievalRun::nearest.
constexpr double as_good = 3e-4;

/// Seed of run `index`: a splitmix64 step, so that runs do not depend on one another.
std::uint64_t run_seed(std::uint64_t seed, int index) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(index);
  if (index == 0) return seed;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

bool stopped(const RetrievalOptions& options) {
  return options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Below this the objective is zero for every purpose.
double floor_of(const Prepared& prepared) {
  return 1e-18 * (prepared.b().squaredNorm() + prepared.problem().objective.weighted_constant()) + 1e-30;
}

/// What to scale by where something small beside phi = `value` is added to it: phi itself, unless it is zero:
/// what is added then moves it by second order only.
double level_of(const Prepared& prepared, double value) {
  return value > floor_of(prepared) ? value : 1e11 * floor_of(prepared);
}

/// A feasible point as close to `p` as rounding allows, or `p` itself where there is none near.
Eigen::VectorXd repaired(const Prepared& prepared, Eigen::VectorXd p) {
  const Bounds& bounds = prepared.bounds();
  if (prepared.smallest_margin(p) >= 0.0) return p;
  if (bounds.total_mass_lower == bounds.total_mass_upper) {
    // A sum is exact for no choice of masses but the right one: move the heaviest by the last digits.
    int heaviest = 0;
    for (int i = 0; i < p.size(); i += 10)
      if (p[i] > p[heaviest] && bounds.upper[i] > bounds.lower[i]) heaviest = i;
    for (int k = 0; k < 4; ++k) {
      double total = 0.0;
      for (int i = 0; i < p.size(); i += 10) total += p[i];
      p[heaviest] += bounds.total_mass_lower - total;
    }
    if (prepared.smallest_margin(p) >= 0.0) return p;
  }
  if (!prepared.interior()) return p;
  const Eigen::VectorXd x = prepared.to_x(p), inside = prepared.to_x(*prepared.interior());
  double part = 1e-11;
  while (part < 1e-3) {
    Eigen::VectorXd mixed =
        prepared.to_p(x + part * (inside - x)).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    if (prepared.smallest_margin(mixed) >= 0.0) return mixed;
    part *= 10.0;
  }
  return p;
}

/// One run of Algorithm 1 and its feasible end.
class Run {
 public:
  Run(const Prepared& prepared, const RetrievalOptions& options, int index)
      : prepared_(prepared), options_(options), floor_(floor_of(prepared)) {
    run_.index = index;
    run_.seed = run_seed(options.seed, index);
  }

  RetrievalRun operator()() {
    const auto start = std::chrono::steady_clock::now();
    const Eigen::VectorXd origin = random_start();
    Eigen::VectorXd p = origin;
    for (int k = 1; k <= options_.steps && !stopped(options_); ++k) p = step(p, k);
    finish(p);
    run_.p = run_.nearest = found_ ? feasible_ : p;
    if (found_) run_.nearest = nearest(origin);
    run_.weighted = prepared_.phi(run_.p);
    run_.objective = prepared_.problem().objective.value(standard_parameters(run_.p));
    run_.feasible = found_;
    run_.penalty = found_ ? 0.0 : prepared_.gamma(run_.p);
    run_.seconds = seconds_since(start);
    return run_;
  }

 private:
  Eigen::VectorXd random_start() {
    std::mt19937_64 generator(run_.seed);
    const Bounds& bounds = prepared_.bounds();
    Eigen::VectorXd p = bounds.lower;
    for (Eigen::Index i = 0; i < p.size(); ++i)
      p[i] += (bounds.upper[i] - bounds.lower[i]) * static_cast<double>(generator() >> 11) * 0x1p-53;
    return p;
  }

  /// Lines 4 to 6 of Algorithm 1.
  Eigen::VectorXd step(const Eigen::VectorXd& from, int k) {
    const double xi = 10.0 * (k - 1);  // xi_1 = 0, xi_{k+1} = 10 k
    const double before = prepared_.f(from, xi);
    Eigen::VectorXd p =
        detail::solve_global(prepared_, from, xi, options_.global, options_.global_evaluations,
                             run_.seed + static_cast<std::uint64_t>(k), options_.stop);
    const bool improved = prepared_.f(p, xi) < before;
    // A minimum without penalty stays one when the penalty grows.
    if (settled_ && !improved) return p;
    LocalTask task;
    task.xi = xi;
    task.alternatives = prepared_.alternatives(p);
    task.scale = 1.0 / std::max(prepared_.f(p, xi), floor_);
    task.stop = options_.stop;
    const LocalSolution solution = detail::solve_local(prepared_, p, task);
    const double after = prepared_.f(solution.p, xi);
    const double was = prepared_.f(p, xi);
    if (after < was) p = solution.p;
    keep(p);
    // Once the penalty is exact and the objective was of the scale that Ipopt was told, it is solved.
    settled_ = xi > 0.0 && solution.converged && found_ && value_ <= after * (1.0 + 1e-6) + floor_ &&
               (after >= 0.5 * was || after <= floor_);
    return p;
  }

  /// Hard constraints, with a margin, from `p`; then the other alternatives of conditional constraints.
  void finish(const Eigen::VectorXd& p) {
    const std::vector<Constraint>& constraints = prepared_.bounds().constraints;
    std::vector<int> alternatives = prepared_.alternatives(found_ ? feasible_ : p);
    if (!settled_) polish(p, alternatives);
    polish_from_inside(found_ ? feasible_ : p, alternatives);
    if (!found_ && !stopped(options_)) {
      // The printed penalties may be light beside the objective: a heavy one finds the feasible set first.
      LocalTask heavy;
      heavy.xi = 1e3 * std::max(1.0, prepared_.phi(p));
      heavy.alternatives = alternatives;
      heavy.scale = 1.0 / std::max(prepared_.f(p, heavy.xi), floor_);
      heavy.stop = options_.stop;
      const Eigen::VectorXd closer = detail::solve_local(prepared_, p, heavy).p;
      alternatives = prepared_.alternatives(closer);
      polish(closer, alternatives);
    }
    int tries = 24;
    for (std::size_t c = 0; c < constraints.size(); ++c) {
      const int here = alternatives[c];
      for (int a = 0; a < static_cast<int>(constraints[c].alternatives.size()); ++a) {
        if (a == here || tries-- <= 0 || stopped(options_) || (found_ && value_ <= floor_)) continue;
        std::vector<int> other = alternatives;
        other[c] = a;
        const double before = value_;
        const bool had = found_;
        polish(found_ ? feasible_ : p, other);
        if (found_ && (!had || value_ < before * (1.0 - 1e-9))) alternatives = other;
      }
    }
  }

  void polish(Eigen::VectorXd p, const std::vector<int>& alternatives) {
    for (int pass = 0; pass < 4 && !stopped(options_); ++pass) {
      const double before = prepared_.phi(p);
      LocalTask task;
      task.hard = true;
      task.alternatives = alternatives;
      task.scale = 1.0 / std::max(before, floor_);
      task.stop = options_.stop;
      const LocalSolution solution = detail::solve_local(prepared_, p, task);
      keep(solution.p);
      const double after = prepared_.phi(solution.p);
      if (after <= floor_ || (!(after < before * 0.5) && solution.converged)) break;  // the scale was right
      p = solution.p;
    }
  }

  /// An interior-point method that starts on a wall may crawl along it and take that for a minimum: the same
  /// from half way to a point well inside, which in a convex problem leads to the minimum.
  void polish_from_inside(const Eigen::VectorXd& p, const std::vector<int>& alternatives) {
    if (!prepared_.interior()) return;
    const Eigen::VectorXd inside =
        prepared_.to_p(0.5 * (prepared_.to_x(p) + prepared_.to_x(*prepared_.interior())));
    for (int pass = 0; pass < 4 && !stopped(options_); ++pass) {
      const double before = found_ ? value_ : prepared_.phi(p);
      if (before <= floor_) break;
      LocalTask task;
      task.hard = true;
      task.alternatives = alternatives;
      task.scale = 1.0 / before;
      task.stop = options_.stop;
      keep(detail::solve_local(prepared_, inside, task).p);
      if (!(value_ < before * 0.5)) break;  // the scale was right
    }
  }

  /// As good a solution as the one found, as close to the random start as that lets it be.
  Eigen::VectorXd nearest(const Eigen::VectorXd& origin) {
    LocalTask task;
    task.hard = true;
    task.alternatives = prepared_.alternatives(feasible_);
    task.towards = prepared_.to_x(origin);
    task.scale = 1.0 / level_of(prepared_, value_);
    // The objective cannot grow by more than this part of itself.
    task.pull = as_good / task.scale / (prepared_.to_x(feasible_) - task.towards).squaredNorm();
    task.stop = options_.stop;
    const Eigen::VectorXd p = repaired(prepared_, detail::solve_local(prepared_, feasible_, task).p);
    const bool good = prepared_.phi(p) <= (1.0 + 2.0 * as_good) * value_ + 100.0 * floor_;
    return good && prepared_.smallest_margin(p) >= 0.0 ? p : feasible_;
  }

  void keep(const Eigen::VectorXd& p) {
    const Eigen::VectorXd candidate = repaired(prepared_, p);
    const double value = prepared_.phi(candidate);
    if ((found_ && !(value < value_)) || prepared_.smallest_margin(candidate) < 0.0) return;
    found_ = true;
    value_ = value;
    feasible_ = candidate;
  }

  const Prepared& prepared_;
  const RetrievalOptions& options_;
  double floor_;
  RetrievalRun run_;
  bool settled_ = false;
  bool found_ = false;
  double value_ = std::numeric_limits<double>::infinity();
  Eigen::VectorXd feasible_;
};

bool better(const RetrievalRun& a, const RetrievalRun& b) {
  if (a.feasible != b.feasible) return a.feasible;
  if (!a.feasible) return a.penalty != b.penalty ? a.penalty < b.penalty : a.index < b.index;
  return a.weighted != b.weighted ? a.weighted < b.weighted : a.index < b.index;
}

bool agree(const std::vector<RetrievalRun>& runs, int needed, double floor) {
  double best = std::numeric_limits<double>::infinity();
  for (const RetrievalRun& run : runs)
    if (run.feasible) best = std::min(best, run.weighted);
  const auto close = std::count_if(runs.begin(), runs.end(), [&](const RetrievalRun& run) {
    return run.feasible && run.weighted <= best * (1.0 + agreement) + floor;
  });
  return close >= needed;
}

/// Without a prior: moves the best set towards uniform solids, which the data and the bounds leave no other
/// choice to pick, as far as phi does not notice.
void apply_reference(const Prepared& prepared, const RetrievalOptions& options, RetrievalResult& result) {
  const double best = prepared.phi(result.p), floor = floor_of(prepared);
  const double distance = detail::prior_distance(prepared, prepared.to_x(result.p));
  if (!std::isfinite(distance) || !(distance > 0.0)) return;
  LocalTask task;
  task.hard = true;
  task.alternatives = prepared.alternatives(result.p);
  // The distance cannot fall by more than itself, so phi cannot grow by more than this part of itself.
  task.prior_weight = 0.5 * as_good * level_of(prepared, best) / distance;
  task.scale = 1.0 / level_of(prepared, best);
  task.stop = options.stop;
  const Eigen::VectorXd p = repaired(prepared, detail::solve_local(prepared, result.p, task).p);
  if (prepared.smallest_margin(p) >= 0.0 && prepared.phi(p) <= best * (1.0 + as_good) + 100.0 * floor)
    result.p = p;
}

/// Moves the best set towards the prior, among those whose objective is as good; see Prior::tolerance.
void apply_prior(const Prepared& prepared, const RetrievalOptions& options, RetrievalResult& result) {
  const double best = prepared.phi(result.p);
  const double reference = std::max(best, 1e-9 * prepared.b().squaredNorm());
  const double allowed = best * (1.0 + prepared.problem().prior->tolerance) + floor_of(prepared);
  double distance = detail::prior_distance(prepared, prepared.to_x(result.p));
  result.trade_off.push_back({0.0, result.objective, distance});
  Eigen::VectorXd p = result.p;
  for (double part = 1e-8; part < 20.0 && !stopped(options); part *= 10.0) {
    LocalTask task;
    task.hard = true;
    task.alternatives = prepared.alternatives(p);
    task.prior_weight = part * reference / std::max(distance, 1e-12);
    task.scale = 1.0 / reference;
    task.stop = options.stop;
    const LocalSolution solution = detail::solve_local(prepared, p, task);
    const Eigen::VectorXd candidate = repaired(prepared, solution.p);
    if (!solution.converged || prepared.smallest_margin(candidate) < 0.0) continue;
    p = candidate;
    const double now = detail::prior_distance(prepared, prepared.to_x(p));
    result.trade_off.push_back(
        {task.prior_weight, prepared.problem().objective.value(standard_parameters(p)), now});
    if (prepared.phi(p) <= allowed && now < result.prior_distance) {
      result.p = p;
      result.prior_distance = now;
    }
    if (part == 1e-8) result.prior_distance = std::min(distance, now);
  }
}

}  // namespace

RetrievalResult retrieve(const RetrievalProblem& problem, const RetrievalOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  validate(problem);
  if (options.runs < 1 || options.steps < 1) throw Error("retrieve: runs and steps must be at least 1");
  const Prepared prepared(problem);
  RetrievalResult result;
  RetrievalRun fallback;  // what an early interrupt leaves
  if (prepared.interior() && prepared.smallest_margin(*prepared.interior()) >= 0.0) {
    fallback.p = *prepared.interior();
    fallback.feasible = true;
  } else {
    fallback.p = 0.5 * (problem.bounds.lower + problem.bounds.upper);
    fallback.penalty = prepared.gamma(fallback.p);
  }
  fallback.index = options.runs;
  fallback.weighted = prepared.phi(fallback.p);
  fallback.nearest = fallback.p;
  RetrievalRun partial = fallback;

  RetrievalReport part;  // what this rank makes of a wave
  std::mutex mutex;
  const auto make = [&](int index) {
    if (stopped(options)) return;
    const RetrievalRun run = Run(prepared, options, index)();
    const std::lock_guard<std::mutex> lock(mutex);
    if (stopped(options)) {
      if (better(run, partial)) partial = run;
      return;
    }
    part.runs.push_back(run);
    if (!options.progress) return;
    double best = std::numeric_limits<double>::infinity();
    for (const auto* runs : {&result.runs, &part.runs})
      for (const RetrievalRun& other : *runs)
        if (other.feasible) best = std::min(best, other.objective);
    options.progress(static_cast<int>(result.runs.size() + part.runs.size()), options.runs, best);
  };
  tbb::task_arena arena(options.threads > 0 ? options.threads : tbb::task_arena::automatic);
  const int waves = options.agreeing_runs > 0 ? std::max(wave, options.agreeing_runs) : options.runs;
  for (int first = 0; first < options.runs && !result.interrupted; first += waves) {
    std::vector<int> mine;
    for (int index = first; index < std::min(first + waves, options.runs); ++index)
      if (index % options.ranks == options.rank) mine.push_back(index);
    arena.execute(
        [&] { tbb::parallel_for(std::size_t{0}, mine.size(), [&](std::size_t k) { make(mine[k]); }); });
    part.interrupted = stopped(options);
    if (part.interrupted && partial.index < options.runs) part.runs.push_back(partial);
    if (options.gather) options.gather(part);
    result.interrupted = part.interrupted;
    result.runs.insert(result.runs.end(), part.runs.begin(), part.runs.end());
    part.runs.clear();
    std::sort(result.runs.begin(), result.runs.end(),
              [](const RetrievalRun& a, const RetrievalRun& b) { return a.index < b.index; });
    if (options.agreeing_runs > 0 && agree(result.runs, options.agreeing_runs, floor_of(prepared))) break;
  }

  const auto best = std::min_element(result.runs.begin(), result.runs.end(), better);
  const RetrievalRun& chosen = best != result.runs.end() && better(*best, fallback) ? *best : fallback;
  result.p = chosen.p;
  result.spread = Eigen::VectorXd::Zero(prepared.size());
  if (best != result.runs.end() && best->feasible) {
    Eigen::VectorXd low = best->nearest, high = best->nearest;
    for (const RetrievalRun& run : result.runs) {
      if (!run.feasible || run.weighted > 1.01 * best->weighted + floor_of(prepared)) continue;
      low = low.cwiseMin(run.nearest);
      high = high.cwiseMax(run.nearest);
    }
    result.spread = 0.5 * (high - low);
  }
  if (chosen.feasible && !result.interrupted) {
    if (problem.prior)
      apply_prior(prepared, options, result);
    else
      apply_reference(prepared, options, result);
  }
  const Eigen::VectorXd pi = standard_parameters(result.p);
  result.links = unstack(result.p);
  result.linear_unknowns = problem.objective.linear_unknowns(pi);
  result.objective = problem.objective.value(pi);
  result.feasible = prepared.smallest_margin(result.p) >= 0.0;
  result.penalty = result.feasible ? 0.0 : prepared.gamma(result.p);
  for (const LinkInertia& link : result.links) result.total_mass += link.mass;
  result.constraints = constraint_margins(problem.bounds, result.links);
  result.seconds = seconds_since(start);
  return result;
}

std::vector<ConstraintMargin> constraint_margins(const Bounds& bounds,
                                                 const std::vector<LinkInertia>& links) {
  if (static_cast<int>(links.size()) != bounds.links())
    throw Error("constraint_margins: " + std::to_string(links.size()) + " links, bounds for " +
                std::to_string(bounds.links()));
  constexpr double on_it = 1e-5;  // part of the range, or of the inertia, that counts as active
  const Eigen::VectorXd p = stack(links);
  std::vector<ConstraintMargin> margins;
  const auto add = [&](const std::string& name, double margin, double size) {
    margins.push_back({name, margin, margin <= on_it * size});
  };
  double total = 0.0;
  for (int i = 0; i < bounds.links(); ++i) {
    const std::string link = "link " + std::to_string(i + 1) + ": ";
    total += p[10 * i];
    const double half_trace = 0.5 * links[static_cast<std::size_t>(i)].inertia.trace();
    add(link + "mass > 0, eq. (11)", p[10 * i], bounds.upper[10 * i]);
    add(link + "triangle inequality, eq. (16)", detail::triangle_margin(p, i), half_trace);
    for (int k = 10 * i; k < 10 * i + 10; ++k) {
      const double range = bounds.upper[k] - bounds.lower[k];
      add(variable_name(k) + " >= lower bound", p[k] - bounds.lower[k], range);
      add(variable_name(k) + " <= upper bound", bounds.upper[k] - p[k], range);
    }
  }
  if (bounds.total_mass_lower > 0.0)
    add("total mass >= lower bound, eq. (30)", total - bounds.total_mass_lower, total);
  if (std::isfinite(bounds.total_mass_upper))
    add("total mass <= upper bound, eq. (30)", bounds.total_mass_upper - total, total);
  for (const Constraint& constraint : bounds.constraints) add(constraint.name, constraint.margin(p), 0.1);
  return margins;
}

}  // namespace dynid
