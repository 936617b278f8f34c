// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/excite.hpp"

#include <nlopt.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <numeric>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/identification/predict.hpp"
#include "exciting_clearance.hpp"
#include "exciting_objective.hpp"

namespace dynid {
namespace {

using detail::Clearances;
using detail::ExciteObjective;
using detail::Proximity;

constexpr double least_movement = 0.01;   // [rad or m] below which a joint does not move
constexpr double check_rate = 1000.0;     // [Hz] limits are checked at
constexpr double criterion_rate = 200.0;  // [Hz] the reported criterion is computed at
// Periods in the duration, where the base frequency is free. A series rests at its ends only by jerk-free
// starts where they approach a whole number, and by fewer conditions at it: searches would stick there.
constexpr double fewest_periods = 1.02, most_periods = 1.98, most_periods_ramped = 3.0;

/// Uniform and normal numbers that are the same on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream) {
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                           static_cast<std::uint32_t>(stream)};
    engine_.seed(sequence);
  }
  double uniform(double low, double high) { return low + (high - low) * double(engine_() >> 11) * 0x1.0p-53; }
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
    return radius * std::cos(uniform(0.0, 2.0 * M_PI));
  }

 private:
  std::mt19937_64 engine_;
};

std::string in_words(const Robot& robot, int j) {
  return "joint " + std::to_string(j + 1) + " ('" + robot.joints[static_cast<std::size_t>(j)].name + "')";
}

bool bounded(const JointLimits& limits) { return std::isfinite(limits.lower) && std::isfinite(limits.upper); }
double half_range(const JointLimits& limits) {
  return bounded(limits) ? 0.5 * (limits.upper - limits.lower) : M_PI;
}
double middle(const JointLimits& limits) {
  return bounded(limits) ? 0.5 * (limits.upper + limits.lower) : 0.0;
}
const JointLimits& limits_of(const Robot& robot, int j) {
  return robot.joints[static_cast<std::size_t>(j)].limits;
}
bool has_inertia(const Robot& robot) { return robot.parameters().cwiseAbs().maxCoeff() > 0.0; }

void check_options(const Robot& robot, const ExciteOptions& options) {
  const auto refuse = [](const std::string& what) { throw Error("exciting motion: " + what); };
  if (options.starts < 1) refuse("the number of starts is not positive");
  if (options.effort < 10) refuse("fewer than 10 evaluations a start");
  if (options.threads < 0) refuse("the number of threads is negative");
  if (!(options.margin >= 0.0 && options.margin < 0.5)) refuse("the margin is not within 0..0.5");
  if (options.base_period < 0.0 || !std::isfinite(options.base_period)) refuse("the base period is negative");
  const Eigen::VectorXd& weights = options.regressor.weights;
  if (weights.size() != 0 && weights.size() != robot.size())
    refuse(std::to_string(weights.size()) + " weights for " + std::to_string(robot.size()) + " joints");
  if (weights.size() != 0 && !(weights.allFinite() && weights.minCoeff() > 0.0))
    refuse("a weight is not positive");
  MotionShape shape{options.kind, options.harmonics, 1.0, options.duration, options.ramp};
  shape.validate();
  if (options.base_period > 0.0) {
    shape.omega = 2.0 * M_PI / options.base_period;
    // Two harmonics of a joint that rests at both ends of a broken number of periods cannot move at all.
    if (rest_projection(shape).trace() < 0.5)
      refuse(std::to_string(options.harmonics) + " harmonics of period " + short_number(options.base_period) +
             " s cannot start and end at rest within " + short_number(options.duration) +
             " s: more harmonics, or a " + "duration of whole periods, are needed");
  } else if (options.kind == MotionKind::fourier && options.harmonics < 2) {
    refuse("a series that starts and ends at rest has at least two harmonics");
  }
}

/// What a start is made of: the base frequency, and whether it may move.
struct Frequency {
  double period;
  bool free;
};
Frequency frequency_of_start(const ExciteOptions& options, int start, Random& random) {
  if (options.base_period > 0.0) return {options.base_period, false};
  const double D = options.duration;
  if (options.kind == MotionKind::ramped || (options.harmonics > 2 && start % 4 == 2))
    return {D / random.uniform(1.1, 1.9), true};
  // A series whose ends coincide keeps two coefficients more a joint: whole numbers of periods have starts of
  // their own.
  return {start % 4 == 1 ? D / 2.0 : D, false};
}

Eigen::VectorXd first_guess(const Robot& robot, const ExciteObjective& objective, const MotionShape& shape,
                            Random& random) {
  const int n = robot.size(), rows = 2 * shape.harmonics;
  Eigen::MatrixXd c(rows, n);
  for (double& x : c.reshaped()) x = random.normal();
  c = rest_projection(shape) * c;
  const MotionBasis basis(shape, Eigen::VectorXd::LinSpaced(200, 0.0, shape.duration));
  Eigen::VectorXd offset(n);
  for (int j = 0; j < n; ++j) {
    const JointLimits& limits = limits_of(robot, j);
    const auto share = [&](const Eigen::MatrixXd& terms, double limit) {
      return std::isfinite(limit) ? (terms * c.col(j)).cwiseAbs().maxCoeff() / limit : 0.0;
    };
    const double used = std::max({share(basis.q, half_range(limits)), share(basis.dq, limits.velocity),
                                  share(basis.ddq, limits.acceleration), share(basis.jerk, limits.jerk)});
    c.col(j) *= random.uniform(0.4, 0.7) / std::max(used, 1e-12);
    offset[j] = middle(limits) + 0.3 * half_range(limits) * random.uniform(-1.0, 1.0);
  }
  return objective.unknowns(c, offset);
}

/// One local search after another; keeps the best point seen.
class Search {
 public:
  Search(ExciteObjective& objective, Eigen::VectorXd x, double free_low, double free_high)
      : objective_(objective), x_(std::move(x)), low_(free_low), high_(free_high) {}

  void run(int exponent, double stiffness, int evaluations) {
    objective_.set_stage(exponent, stiffness);
    best_ = std::numeric_limits<double>::infinity();
    const auto size = static_cast<unsigned>(x_.size());
    using Owned = std::unique_ptr<std::remove_pointer_t<nlopt_opt>, void (*)(nlopt_opt)>;
    const Owned opt(nlopt_create(NLOPT_LD_LBFGS, size), nlopt_destroy);
    nlopt_set_min_objective(opt.get(), evaluate, this);
    if (low_ < high_) {
      std::vector<double> low(size, -HUGE_VAL), high(size, HUGE_VAL);
      low.back() = low_;
      high.back() = high_;
      nlopt_set_lower_bounds(opt.get(), low.data());
      nlopt_set_upper_bounds(opt.get(), high.data());
    }
    nlopt_set_maxeval(opt.get(), evaluations);
    nlopt_set_vector_storage(opt.get(), 30);
    nlopt_set_ftol_rel(opt.get(), 1e-7);
    std::vector<double> at(x_.data(), x_.data() + x_.size());
    double value = 0.0;
    const Eigen::VectorXd start = x_;
    nlopt_optimize(opt.get(), at.data(), &value);  // whatever it returns, the best point seen is kept
    if (!std::isfinite(best_)) x_ = start;
  }
  const Eigen::VectorXd& x() const { return x_; }
  double best() const { return best_; }
  int evaluations() const { return evaluations_; }

 private:
  static double evaluate(unsigned size, const double* x, double* gradient, void* self) {
    auto& search = *static_cast<Search*>(self);
    ++search.evaluations_;
    const Eigen::Map<const Eigen::VectorXd> at(x, size);
    const double value = at.allFinite() ? search.objective_(at, gradient) : HUGE_VAL;
    if (value < search.best_) {
      search.best_ = value;
      search.x_ = at;
    }
    return value;
  }

  ExciteObjective& objective_;
  Eigen::VectorXd x_;
  double low_, high_;
  double best_ = std::numeric_limits<double>::infinity();
  int evaluations_ = 0;
};

double log_determinant(const TriangularFactor& factor, Eigen::Index samples) {
  return 2.0 * factor.R().diagonal().cwiseAbs().array().log().sum() -
         factor.columns() * std::log(double(samples));
}

}  // namespace

TriangularFactor excitation_factor(const Robot& robot, const BaseParameters& base, const Trajectory& motion,
                                   const RegressorOptions& options) {
  const int n = robot.size(), r = base.size(), p = r + (options.friction ? 3 * n : 0);
  if (motion.joints() != n || motion.dq.rows() != motion.samples() || motion.ddq.rows() != motion.samples() ||
      motion.dq.cols() != n || motion.ddq.cols() != n)
    throw Error(motion.source + ": a motion of " + std::to_string(motion.joints()) + " joints for " +
                std::to_string(n));
  const Model<> model(robot);
  Workspace<> workspace(model);
  Eigen::MatrixXd Y(n, 10 * n);
  Eigen::VectorXd q(n), dq(n), ddq(n);
  TriangularFactor factor(p);
  constexpr Eigen::Index samples_a_block = 64;
  Eigen::MatrixXd block;
  for (Eigen::Index first = 0; first < motion.samples(); first += samples_a_block) {
    const Eigen::Index count = std::min(samples_a_block, motion.samples() - first);
    block.setZero(count * n, p + 1);
    for (Eigen::Index i = 0; i < count; ++i) {
      q = motion.q.row(first + i);
      dq = motion.dq.row(first + i);
      ddq = motion.ddq.row(first + i);
      regressor(model, workspace, q, dq, ddq, Y);
      for (int j = 0; j < n; ++j) {
        const Eigen::Index row = i * n + j;
        for (int c = 0; c < r; ++c) {
          const int column = base.columns[static_cast<std::size_t>(c)];
          block(row, c) = column < base.standard ? Y(j, column) : column - base.standard == j ? ddq[j] : 0.0;
        }
        if (options.friction) block.block<1, 3>(row, r + 3 * j) = friction_regressor(LinearFriction{}, dq[j]);
        if (options.weights.size() == n) block.row(row) *= options.weights[j];
      }
    }
    factor.add(block);
  }
  return factor;
}

std::vector<LimitMargin> limit_margins(const Robot& robot, const CollisionModel& collision,
                                       const ExcitingMotion& motion) {
  const int n = robot.size();
  const auto steps = static_cast<Eigen::Index>(std::ceil(motion.shape().duration * check_rate));
  Eigen::MatrixXd jerk;
  const Trajectory at = motion.at(Eigen::VectorXd::LinSpaced(steps + 1, 0.0, motion.shape().duration), &jerk);
  std::vector<LimitMargin> margins;
  const auto most = [&](const char* name, int j, double used, double limit, const char* unit) {
    if (std::isfinite(limit))
      margins.push_back({name, j + 1, {}, limit - used, (limit - used) / limit, unit});
  };
  const auto unit = [&](int j, const char* angle, const char* length) {
    return robot.joints[static_cast<std::size_t>(j)].type == JointType::prismatic ? length : angle;
  };
  for (int j = 0; j < n; ++j) {
    const JointLimits& limits = limits_of(robot, j);
    if (!std::isfinite(limits.lower) && !std::isfinite(limits.upper)) continue;
    const double margin =
        std::min(at.q.col(j).minCoeff() - limits.lower, limits.upper - at.q.col(j).maxCoeff());
    margins.push_back({"position", j + 1, {}, margin, margin / half_range(limits), unit(j, "rad", "m")});
  }
  for (int j = 0; j < n; ++j)
    most("velocity", j, at.dq.col(j).cwiseAbs().maxCoeff(), limits_of(robot, j).velocity,
         unit(j, "rad/s", "m/s"));
  for (int j = 0; j < n; ++j)
    most("acceleration", j, at.ddq.col(j).cwiseAbs().maxCoeff(), limits_of(robot, j).acceleration,
         unit(j, "rad/s^2", "m/s^2"));
  for (int j = 0; j < n; ++j)
    most("jerk", j, jerk.col(j).cwiseAbs().maxCoeff(), limits_of(robot, j).jerk, unit(j, "rad/s^3", "m/s^3"));
  if (has_inertia(robot)) {
    const Eigen::MatrixXd tau = predict_torque(robot, at.q, at.dq, at.ddq).tau;
    for (int j = 0; j < n; ++j)
      most("torque", j, tau.col(j).cwiseAbs().maxCoeff(), limits_of(robot, j).torque, unit(j, "N m", "N"));
  }

  Clearances clearances(robot, collision);
  if (clearances.pairs().empty()) return margins;
  const Model<> model(robot);
  Workspace<> workspace(model);
  std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(n) + 1);
  std::vector<Proximity> near;
  struct Least {
    double distance = std::numeric_limits<double>::infinity();
    int pair = -1;
  } least[3];
  for (Eigen::Index i = 0; i <= steps; ++i) {
    forward_kinematics(model, workspace, at.q.row(i).transpose(), poses);
    clearances.near(poses, std::numeric_limits<double>::infinity(), near);
    for (const Proximity& one : near) {
      Least& so_far = least[static_cast<int>(clearances.pairs()[static_cast<std::size_t>(one.pair)].kind)];
      if (one.distance < so_far.distance) so_far = {one.distance, one.pair};
    }
  }
  const char* const names[] = {"self_collision", "floor", "box"};
  for (int kind = 0; kind < 3; ++kind) {
    if (least[kind].pair < 0) continue;
    const Clearances::Pair& pair = clearances.pairs()[static_cast<std::size_t>(least[kind].pair)];
    const double margin = least[kind].distance - collision.clearance;
    margins.push_back({names[kind], 0, {pair.name_a, pair.name_b}, margin, margin / 0.1, "m"});
  }
  return margins;
}

void check_limits(const Robot& robot, const CollisionModel& collision, const ExciteOptions& options) {
  const int n = robot.size();
  const auto refuse = [&](int j, const std::string& what) { throw Error(in_words(robot, j) + ": " + what); };
  for (int j = 0; j < n; ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    const JointLimits& limits = joint.limits;
    if (joint.type != JointType::continuous && !bounded(limits))
      refuse(j, "has no lower or no upper position limit: an exciting motion needs both");
    if (limits.lower > limits.upper)
      refuse(j, "the lower position limit " + short_number(limits.lower) + " is above the upper one " +
                    short_number(limits.upper));
    if (!std::isfinite(limits.velocity)) refuse(j, "has no velocity limit: an exciting motion needs one");
    const std::pair<const char*, double> each[] = {{"velocity", limits.velocity},
                                                   {"acceleration", limits.acceleration},
                                                   {"jerk", limits.jerk},
                                                   {"torque", limits.torque}};
    for (const auto& [name, limit] : each)
      if (!(limit > 0.0)) refuse(j, std::string(name) + " limit " + short_number(limit) + " is not positive");
    // From rest to rest, at best: half the time each way, a quarter for each phase of constant jerk.
    const double D = options.duration;
    const std::pair<const char*, double> reach[] = {
        {"the position limits", 2.0 * half_range(limits)},
        {"the velocity limit", limits.velocity * D},
        {"the acceleration limit", limits.acceleration * D * D / 4.0},
        {"the jerk limit", limits.jerk * D * D * D / 32.0}};
    for (const auto& [name, movement] : reach)
      if (movement < least_movement)
        refuse(j, std::string(name) + " lets it move by at most " + short_number(movement) + " in " +
                      short_number(D) + " s: nothing could be identified");
  }

  Clearances clearances(robot, collision);
  const Model<> model(robot);
  Workspace<> workspace(model);
  Random random(0, 0);
  constexpr int poses_drawn = 1000;
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> widest(clearances.pairs().size(), -infinity);
  Eigen::VectorXd least_torque = Eigen::VectorXd::Constant(n, infinity), q(n), tau(n);
  std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(n) + 1);
  std::vector<Proximity> near;
  for (int k = 0; k < poses_drawn; ++k) {
    for (int j = 0; j < n; ++j) {
      const JointLimits& limits = limits_of(robot, j);
      q[j] = middle(limits) + half_range(limits) * random.uniform(-1.0, 1.0);
    }
    forward_kinematics(model, workspace, q, poses);
    clearances.near(poses, infinity, near);
    for (const Proximity& one : near)
      widest[static_cast<std::size_t>(one.pair)] =
          std::max(widest[static_cast<std::size_t>(one.pair)], one.distance);
    gravity(model, workspace, q, tau);
    least_torque = least_torque.cwiseMin(tau.cwiseAbs());
  }
  for (std::size_t k = 0; k < widest.size(); ++k) {
    const Clearances::Pair& pair = clearances.pairs()[k];
    if (widest[k] < collision.clearance)
      throw Error(collision.source + ": " + pair.name_a + " and " + pair.name_b + " are at most " +
                  short_number(widest[k]) +
                  " m apart in every pose drawn within the position limits, less than the clearance " +
                  short_number(collision.clearance) + " m (see ignore)");
  }
  for (int j = 0; j < n; ++j)
    if (least_torque[j] > limits_of(robot, j).torque)
      refuse(j, "the torque limit " + short_number(limits_of(robot, j).torque) +
                    " holds none of the poses drawn within the position limits (at least " +
                    short_number(least_torque[j]) + " is needed)");
}

Excitation excite(const Robot& robot, const CollisionModel& collision, const ExciteOptions& options) {
  check_options(robot, options);
  check_limits(robot, collision, options);
  const BaseParameters base = base_parameters(robot, options.regressor.rotor_inertia);

  struct Candidate {
    MotionShape shape;
    bool free = false;
    std::unique_ptr<ExciteObjective> objective;
    std::unique_ptr<Search> search;
    double rank = 0.0;
    Excitation result;
  };
  const int starts = options.starts, refined = (starts + 3) / 4;
  std::vector<Candidate> candidates(static_cast<std::size_t>(starts));
  std::mutex mutex;
  double done = 0.0;
  const double all = starts + 4.0 * refined;
  const auto advance = [&](double work) {
    const std::lock_guard<std::mutex> lock(mutex);
    done += work;
    if (options.progress) options.progress(std::min(1.0, done / all));
  };
  const double rank_stiffness = 1e3;
  const int last_exponent = 24;

  const auto explore = [&](int start) {
    Candidate& candidate = candidates[static_cast<std::size_t>(start)];
    Random random(options.seed, static_cast<std::uint64_t>(start));
    const Frequency frequency = frequency_of_start(options, start, random);
    candidate.free = frequency.free;
    candidate.shape = {options.kind, options.harmonics, 2.0 * M_PI / frequency.period, options.duration,
                       options.ramp};
    candidate.objective =
        std::make_unique<ExciteObjective>(robot, base, collision, options, candidate.shape, candidate.free);
    const double periods = options.duration / frequency.period;
    const double most = options.kind == MotionKind::ramped ? most_periods_ramped : most_periods;
    const double low = std::log(fewest_periods / periods), high = std::log(most / periods);
    candidate.search = std::make_unique<Search>(
        *candidate.objective, first_guess(robot, *candidate.objective, candidate.shape, random),
        candidate.free ? low : 0.0, candidate.free ? high : 0.0);
    const int third = options.effort / 3;
    candidate.search->run(3, 3.0, third);
    candidate.search->run(6, 30.0, third);
    candidate.search->run(12, 300.0, third);
    candidate.objective->set_stage(last_exponent, rank_stiffness);
    candidate.rank = (*candidate.objective)(candidate.search->x(), nullptr);
    advance(1.0);
  };
  const auto judge = [&](Candidate& candidate) {
    Excitation& out = candidate.result;
    out.motion = candidate.objective->motion(candidate.search->x());
    out.margins = limit_margins(robot, collision, out.motion);
    out.feasible = true;
    out.limiting = -1;
    for (int k = 0; k < static_cast<int>(out.margins.size()); ++k) {
      const LimitMargin& margin = out.margins[static_cast<std::size_t>(k)];
      if (!(margin.margin >= 0.0)) out.feasible = false;
      if (out.limiting < 0 || margin.share < out.margins[static_cast<std::size_t>(out.limiting)].share)
        out.limiting = k;
    }
    const Trajectory motion = out.motion.sampled(criterion_rate);
    const TriangularFactor factor = excitation_factor(robot, base, motion, options.regressor);
    out.columns = factor.columns();
    out.condition_number = condition_number(factor);
    out.log_determinant = log_determinant(factor, motion.samples());
  };
  const auto refine = [&](int start) {
    Candidate& candidate = candidates[static_cast<std::size_t>(start)];
    candidate.search->run(last_exponent, 1e3, 2 * options.effort);
    advance(2.0);
    double stiffness = 1e4;
    int exponent = 2 * last_exponent;
    for (int round = 0; round < 3; ++round, stiffness *= 30.0) {
      candidate.search->run(exponent, stiffness, options.effort);
      judge(candidate);
      if (candidate.result.feasible) break;
    }
    advance(2.0);
  };

  tbb::task_arena arena(options.threads > 0 ? options.threads : tbb::task_arena::automatic);
  std::vector<int> order(candidates.size());
  std::iota(order.begin(), order.end(), 0);
  arena.execute([&] {
    tbb::parallel_for(0, starts, explore, tbb::simple_partitioner());
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return candidates[static_cast<std::size_t>(a)].rank < candidates[static_cast<std::size_t>(b)].rank;
    });
    tbb::parallel_for(
        0, refined, [&](int k) { refine(order[static_cast<std::size_t>(k)]); }, tbb::simple_partitioner());
    tbb::parallel_for(
        refined, starts,
        [&](int k) { judge(candidates[static_cast<std::size_t>(order[static_cast<std::size_t>(k)])]); },
        tbb::simple_partitioner());
  });

  // Within the limits first, then by the criterion, then by the order of the starts.
  const auto cost = [&](const Excitation& e) {
    return options.criterion == ExcitationCriterion::condition ? e.condition_number : -e.log_determinant;
  };
  const auto better = [&](const Excitation& a, const Excitation& b) {
    if (a.feasible != b.feasible) return a.feasible;
    if (!a.feasible && a.limiting >= 0 && b.limiting >= 0)
      return a.margins[static_cast<std::size_t>(a.limiting)].share >
             b.margins[static_cast<std::size_t>(b.limiting)].share;
    return cost(a) < cost(b);
  };
  const Candidate* best = &candidates.front();
  std::vector<ExciteRun> runs;
  for (const Candidate& candidate : candidates) {
    const Excitation& result = candidate.result;
    runs.push_back({static_cast<int>(runs.size()) + 1, 2.0 * M_PI / result.motion.shape().omega,
                    options.criterion == ExcitationCriterion::condition ? result.condition_number
                                                                        : result.log_determinant,
                    result.feasible, candidate.search->evaluations()});
    if (better(result, best->result)) best = &candidate;
  }
  Excitation out = best->result;
  out.runs = std::move(runs);
  return out;
}

}  // namespace dynid
