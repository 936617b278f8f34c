// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynid/model/link_inertia.hpp"
#include "dynid/retrieval/bounds.hpp"
#include "dynid/retrieval/objective.hpp"

namespace dynid {

/// How far a set of parameters is from a known one (CAD, URDF).
enum class PriorDistance {
  entropic,   ///< log-det (Bregman) divergence of the pseudo-inertias, summed over the links; free of units
              ///< and frames
  euclidean,  ///< |S (pi - prior)|^2, S = diag(scale)
};

/// A known set of parameters that picks among equals.
struct Prior {
  std::vector<LinkInertia> links;  ///< physically consistent, base to tip
  PriorDistance distance = PriorDistance::entropic;
  Eigen::VectorXd scale;  ///< euclidean: 10 n; empty: each link's entries in units of its own mass and size
  /// The objective may grow by this part of itself to come closer to the prior.
  double tolerance = 1e-3;
};

/// What Algorithm 1 solves.
struct RetrievalProblem {
  Objective objective;
  Bounds bounds;
  std::optional<Prior> prior;
};

/// Throws Error where the problem cannot be solved or is not one: sizes that differ, validate(bounds), an
/// inconsistent prior. Nothing is optimised.
void validate(const RetrievalProblem& problem);

/// NLopt's global algorithms, as measured in docs/retrieval.md.
enum class GlobalAlgorithm { crs2, mlsl, isres, esch, direct_l, none };

struct RetrievalReport;

struct RetrievalOptions {
  int runs = 10;           ///< Q, independent runs
  int steps = 10;          ///< kappa, steps of a run
  std::uint64_t seed = 1;  ///< of run 0; the seed of run r follows from (seed, r) alone
  int threads = 0;         ///< 0: all cores
  /// 0: all runs; else the runs end once this many of those done agree on the smallest objective to 1e-4 of
  /// it.
  int agreeing_runs = 0;
  GlobalAlgorithm global = GlobalAlgorithm::isres;
  int global_evaluations = 2000;            ///< of f, in each step
  const std::atomic<bool>* stop = nullptr;  ///< set it (from a signal handler, say) to end within a second
  /// Called after each run (serialised; from any thread): runs done, runs asked, smallest feasible objective
  /// so far.
  std::function<void(int done, int of, double best)> progress;
  /// Shares the runs: this process makes those with index = rank modulo ranks. See mpi.hpp.
  int rank = 0;
  int ranks = 1;
  /// Makes every rank's report the whole one; needed where ranks > 1.
  std::function<void(RetrievalReport&)> gather;
};

/// One constraint at the solution.
struct ConstraintMargin {
  std::string name;
  double margin = 0.0;  ///< >= 0 where satisfied, in the constraint's own unit
  bool active = false;  ///< the solution lies on it
};

/// One run of Algorithm 1.
struct RetrievalRun {
  int index = 0;
  std::uint64_t seed = 0;
  double objective = 0.0;  ///< phi of its solution, unweighted
  double weighted = 0.0;   ///< what was minimised: Objective::weighted_value()
  double penalty = 0.0;    ///< gamma: sum of the exterior penalties, eq. (32); 0 when feasible
  bool feasible = false;   ///< every margin >= 0
  double seconds = 0.0;
  Eigen::VectorXd p;  ///< its solution, 10 n
  /// As good a solution (phi within 6e-4 of itself), as close to the run's random start as that lets it be.
  Eigen::VectorXd nearest;
};

/// The solution at one weight of the prior: minimises Objective::weighted_value() + weight * distance.
struct PriorTradeOff {
  double weight = 0.0;
  double objective = 0.0;
  double distance = 0.0;
};

/// All that the runs made: what ranks exchange.
struct RetrievalReport {
  /// Those that ended, by index; where interrupted, also the best of those that had not.
  std::vector<RetrievalRun> runs;
  bool interrupted = false;  ///< `stop` was seen: runs are missing
};

struct RetrievalResult : RetrievalReport {
  std::vector<LinkInertia> links;   ///< the best set, base to tip
  Eigen::VectorXd p;                ///< the same, in the order of Inequality
  Eigen::VectorXd linear_unknowns;  ///< friction of the one-step objective; empty otherwise
  double objective = 0.0;           ///< phi of eq. (29), unweighted
  double penalty = 0.0;
  bool feasible = false;
  double total_mass = 0.0;                    ///< [kg]
  std::vector<ConstraintMargin> constraints;  ///< eqs. (11), (16), bounds, eq. (30), the user's
  /// Half the range of each parameter over RetrievalRun::nearest of the feasible runs within 1 % of the best
  /// objective: what the data leaves free. 10 n; zero where one run stands alone.
  Eigen::VectorXd spread;
  std::vector<PriorTradeOff> trade_off;  ///< empty without a prior
  double prior_distance = 0.0;
  double seconds = 0.0;
};

/// Algorithm 1 of the letter, made strictly feasible; see docs/retrieval.md. The best of the runs is the
/// feasible one of smallest objective, or where there is none the one of smallest penalty. Same result for
/// the same seed whatever the number of threads and ranks. Throws Error as validate() does, before anything
/// is optimised.
RetrievalResult retrieve(const RetrievalProblem& problem, const RetrievalOptions& options = {});

/// Margins of any set of parameters: eqs. (11), (16), bounds, eq. (30), the user's constraints.
std::vector<ConstraintMargin> constraint_margins(const Bounds& bounds, const std::vector<LinkInertia>& links);

/// p of Inequality from the links, and back.
Eigen::VectorXd stack(const std::vector<LinkInertia>& links);
std::vector<LinkInertia> unstack(const Eigen::VectorXd& p);
/// Standard parameters pi, 10 n, eq. (26).
Eigen::VectorXd standard_parameters(const Eigen::VectorXd& p);

}  // namespace dynid
