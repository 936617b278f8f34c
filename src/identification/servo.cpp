// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/servo.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <sstream>

#include "dynid/base/error.hpp"
#include "servo_fit.hpp"

namespace dynid {
namespace {

using detail::Parameters;
using detail::ServoProblem;
using detail::ServoSeries;
using detail::ServoSolution;
using P = ServoParameter;

constexpr double alias_correlation = 0.95;  // of two estimates: a tenth of the variance is their own
constexpr int refined = 4;                  // times as many steps in the final fit
constexpr int short_fit = 8, fold_fit = 10, long_fit = 40;  // iterations

/// A further term: what it frees, and where its search starts.
struct Term {
  const char* name;
  Parameters free;
};
const std::array<Term, 5> all_terms = {{{"rigid_body", {P::compliance}},
                                        {"stribeck_friction", {P::stribeck, P::stribeck_velocity}},
                                        {"load_dependent_friction", {P::load_friction}},
                                        {"torque_saturation", {P::limit}},
                                        {"command_filter", {P::command_lag}}}};

/// Scales of a joint's own, over its logs.
struct Scale {
  double interval = 0.0;  // [s]
  double speed = 0.0;     // rms of the command's, while it moves [rad/s]
  double error = 0.0;     // largest |u - q| [rad]
  double load = 0.0;      // rms of the rigid body's torque [N m]
  bool moves = false;
};

Scale scale_of(const std::vector<ServoSeries>& series) {
  Scale out;
  out.interval = series.front().interval;
  double squares = 0.0, load = 0.0;
  Eigen::Index moving = 0, samples = 0;
  for (const ServoSeries& s : series) {
    for (Eigen::Index i = 1; i < s.t.size(); ++i)
      if (s.t[i] > s.t[i - 1] && s.u[i] != s.u[i - 1]) {
        const double v = (s.u[i] - s.u[i - 1]) / (s.t[i] - s.t[i - 1]);
        squares += v * v;
        ++moving;
      }
    out.error = std::max(out.error, (s.u - s.q).cwiseAbs().maxCoeff());
    load += s.load.squaredNorm();
    samples += s.load.size();
  }
  out.moves = moving > 0;
  if (moving > 0) out.speed = std::sqrt(squares / double(moving));
  if (samples > 0) out.load = std::sqrt(load / double(samples));
  return out;
}

ServoJoint with_term(ServoJoint joint, const Term& term, const Scale& scale) {
  for (const P p : term.free) {
    switch (p) {
      case P::compliance:
        joint.compliance = 0.3 * (joint.coulomb + std::abs(joint.bias)) / std::max(scale.load, 1e-300);
        break;
      case P::stribeck:
        joint.stribeck = 0.3 * joint.coulomb + 0.01 * scale.error;
        break;
      case P::stribeck_velocity:
        joint.stribeck_velocity = std::max(0.5 * scale.speed, 1e-5);
        break;
      case P::load_friction:
        joint.load_friction = 0.1;
        break;
      case P::limit:
        joint.limit = 0.7 * scale.error;
        break;
      case P::command_lag:
        joint.command_lag = scale.interval;
        break;
      default:
        break;
    }
  }
  return joint;
}

/// One part left out: what is fitted, and what is predicted.
struct Fold {
  ServoProblem fit, predict;
};

/// By log where there are enough of them; else each log in as many stretches of time.
std::vector<Fold> folds_of(const std::vector<ServoSeries>& series, const ServoProblem& all, int count,
                           std::vector<ServoSeries>& stretches) {
  std::vector<Fold> folds(static_cast<std::size_t>(count));
  for (Fold& fold : folds) {
    fold.fit = fold.predict = all;
    fold.fit.series.clear(), fold.predict.series.clear();
  }
  std::vector<std::pair<int, const ServoSeries*>> parts;
  if (static_cast<int>(series.size()) >= count) {
    for (std::size_t k = 0; k < series.size(); ++k)
      parts.emplace_back(static_cast<int>(k) % count, &series[k]);
  } else {
    stretches.reserve(series.size() * static_cast<std::size_t>(count));
    for (const ServoSeries& s : series)
      for (int k = 0; k < count; ++k) {
        const Eigen::Index first = s.q.size() * k / count, last = s.q.size() * (k + 1) / count;
        stretches.push_back(detail::part_of(s, first, last - first));
        parts.emplace_back(k, &stretches.back());
      }
  }
  for (const auto& [owner, part] : parts)
    for (int k = 0; k < count; ++k)
      (k == owner ? folds[static_cast<std::size_t>(k)].predict : folds[static_cast<std::size_t>(k)].fit)
          .series.push_back(part);
  return folds;
}

/// Huber's width follows the residual: fitted, measured, fitted again.
ServoSolution settle(const ServoProblem& problem, const ServoJoint& start, const Parameters& free,
                     int iterations) {
  const double width = detail::huber_width(problem, start);
  ServoSolution solution = detail::fit_servo(problem, start, free, width, iterations);
  const double after = detail::huber_width(problem, solution.joint);
  if (after < 0.9 * width) solution = detail::fit_servo(problem, solution.joint, free, after, iterations);
  return solution;
}

struct Candidate {
  std::vector<ServoJoint> joints;  // of each fold
  double held_out = 0.0;
  int better = 0;  // parts left out on which it is at least as good
};

class JointSearch {
 public:
  JointSearch(const std::vector<ServoSeries>& series, const ServoOptions& options)
      : options_(options), scale_(scale_of(series)) {
    all_.substeps = options.substeps;
    all_.longest_delay = options.longest_delay;
    for (const ServoSeries& s : series) all_.series.push_back(&s);
    folds_ = folds_of(series, all_, std::max(2, options.folds), stretches_);
  }

  void run(ServoFit& fit) {
    solution_ = first(all_);
    std::vector<ServoJoint> of_folds(folds_.size());
    tbb::parallel_for(std::size_t{0}, folds_.size(), [&](std::size_t k) {
      of_folds[k] = settle(folds_[k].fit, solution_.joint, free_, fold_fit).joint;
    });
    Eigen::VectorXd errors = held_out(of_folds);
    if (options_.further_terms) {
      std::vector<const Term*> left;
      for (const Term& term : all_terms) left.push_back(&term);
      while (!left.empty()) {
        std::vector<const Term*> tried;
        for (const Term* term : left)
          if (possible(*term)) tried.push_back(term);
        if (tried.empty()) break;
        std::vector<std::vector<ServoJoint>> joints(tried.size(), std::vector<ServoJoint>(folds_.size()));
        tbb::parallel_for(std::size_t{0}, tried.size() * folds_.size(), [&](std::size_t m) {
          const std::size_t i = m / folds_.size(), k = m % folds_.size();
          Parameters free = free_;
          free.insert(free.end(), tried[i]->free.begin(), tried[i]->free.end());
          joints[i][k] =
              settle(folds_[k].fit, with_term(of_folds[k], *tried[i], scale_), free, fold_fit).joint;
        });
        std::size_t best = tried.size();
        double least = (1.0 - options_.least_gain) * errors.mean();
        std::vector<Eigen::VectorXd> after(tried.size());
        for (std::size_t i = 0; i < tried.size(); ++i) {
          after[i] = held_out(joints[i]);
          const auto better = (after[i].array() <= errors.array()).count();
          note(fit, tried[i]->name, errors.mean(), after[i].mean());
          if (after[i].mean() < least && 2 * better > after[i].size()) least = after[i].mean(), best = i;
        }
        if (best == tried.size()) break;
        for (ServoTerm& term : fit.terms)
          if (term.name == tried[best]->name) term.kept = true;
        free_.insert(free_.end(), tried[best]->free.begin(), tried[best]->free.end());
        of_folds = joints[best];
        errors = after[best];
        solution_ = settle(all_, with_term(solution_.joint, *tried[best], scale_), free_, long_fit);
        left.erase(std::find(left.begin(), left.end(), tried[best]));
      }
    }
    // The last digits with a finer step: the discretisation must not show beside the intervals.
    all_.substeps = refined * options_.substeps;
    solution_ = settle(all_, solution_.joint, free_, long_fit);
    fit.identified = true;
    fit.ratios = solution_.joint;
    fit.error = detail::servo_errors(solution_.joint, all_).mean();
    fit.held_out = errors.mean();
  }

  /// By how much the motion seems to precede its command [s]; 0 where a delay of at least zero explains it.
  double earlier_command() const {
    constexpr double telling = 0.8;  // of the loss: a fifth of it goes with the delay's bound alone
    if (solution_.joint.delay > 0.25 * scale_.interval) return 0.0;
    ServoProblem problem = all_;
    problem.substeps = options_.substeps;
    const double width = solution_.width;
    const ServoSolution bounded = detail::fit_servo(problem, solution_.joint, free_, width, short_fit);
    problem.earliest_delay = -4;
    ServoJoint start = solution_.joint;
    start.delay = -scale_.interval;
    const ServoSolution early = detail::fit_servo(problem, start, free_, width, long_fit);
    return early.cost < telling * bounded.cost ? -early.joint.delay : 0.0;
  }

  const Scale& scale() const { return scale_; }
  const ServoProblem& problem() const { return all_; }
  const Parameters& free() const { return free_; }
  const ServoSolution& solution() const { return solution_; }

 private:
  bool possible(const Term& term) const {
    const P p = term.free.front();
    if (p == P::compliance) return scale_.load > 0.0;
    // Without a load that varies it is Coulomb friction by another name.
    if (p == P::load_friction) return std::count(free_.begin(), free_.end(), P::compliance) > 0;
    return true;
  }

  static void note(ServoFit& fit, const char* name, double without, double with) {
    for (ServoTerm& term : fit.terms)
      if (term.name == name) {
        term.without = without, term.with = with;
        return;
      }
    fit.terms.push_back({name, without, with, false});
  }

  Eigen::VectorXd held_out(const std::vector<ServoJoint>& joints) const {
    std::vector<double> errors;
    for (std::size_t k = 0; k < folds_.size(); ++k)
      for (const double e : detail::servo_errors(joints[k], folds_[k].predict)) errors.push_back(e);
    return Eigen::Map<const Eigen::VectorXd>(errors.data(), static_cast<Eigen::Index>(errors.size()));
  }

  /// The best of several starts: the equation error's, and two plain servos that span what there is.
  ServoSolution first(const ServoProblem& problem) const {
    std::vector<ServoJoint> starts;
    if (const std::optional<ServoJoint> start = detail::equation_error(problem)) starts.push_back(*start);
    for (const double frequency : {0.3, 0.8}) {  // [rad] a sampling interval
      ServoJoint start;
      const double w = frequency / scale_.interval;
      start.inertia = 1.0 / (w * w);
      start.damping = 2.0 / w;
      start.coulomb = 0.05 * scale_.error;
      start.delay = scale_.interval;
      starts.push_back(start);
    }
    std::vector<ServoSolution> solutions(starts.size());
    std::vector<double> errors(starts.size());
    tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t k) {
      solutions[k] = settle(problem, starts[k], free_, short_fit);
      errors[k] = detail::servo_errors(solutions[k].joint, problem).mean();
    });
    const auto best = std::min_element(errors.begin(), errors.end()) - errors.begin();
    return settle(problem, solutions[static_cast<std::size_t>(best)].joint, free_, long_fit);
  }

  const ServoOptions& options_;
  Scale scale_;
  ServoProblem all_;
  std::vector<ServoSeries> stretches_;
  std::vector<Fold> folds_;
  Parameters free_ = {P::inertia, P::damping, P::coulomb, P::bias, P::delay};
  ServoSolution solution_;
};

/// Quantile of Student's distribution, two-sided, by Cornish and Fisher's expansion of the normal one.
double student(double confidence, double degrees) {
  const double p = 0.5 + 0.5 * confidence;
  double z = 1.5;
  for (int k = 0; k < 50; ++k) {
    const double error = 0.5 * std::erfc(-z / std::sqrt(2.0)) - p;
    z -= error * std::sqrt(2.0 * M_PI) * std::exp(0.5 * z * z);
  }
  const double n = std::max(degrees, 3.0), z3 = z * z * z, z5 = z3 * z * z;
  return z + (z3 + z) / (4.0 * n) + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n);
}

class Intervals {
 public:
  Intervals(const JointSearch& search, double confidence)
      : information_(detail::servo_information(search.problem(), search.solution(), search.free())),
        joint_(search.solution().joint),
        problem_(search.problem()),
        quantile_(student(confidence, information_.degrees)) {}

  /// A number computed from the ratios; a positive one has its interval on the logarithm.
  template <class F>
  ServoValue value(const std::string& name, const std::string& unit, bool positive, F&& f) const {
    ServoValue out{name, unit, f(joint_), 0.0, 0.0};
    const auto n = static_cast<Eigen::Index>(information_.free.size());
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const P p = information_.free[static_cast<std::size_t>(k)];
      const bool logarithmic = detail::servo_bounds(p, problem_).logarithmic;
      const double step = 1e-4 * std::max(std::abs(joint_[p]), 1e-9);
      ServoJoint up = joint_, down = joint_;
      up[p] += step, down[p] -= step;
      gradient[k] = (f(up) - f(down)) / (2.0 * step) * (logarithmic ? joint_[p] : 1.0);
    }
    const double deviation = std::sqrt(std::max(0.0, gradient.dot(information_.covariance * gradient)));
    bool unseen = false;
    for (Eigen::Index k = 0; k < n; ++k)
      unseen = unseen || (gradient[k] != 0.0 && !information_.visible[static_cast<std::size_t>(k)]);
    if (unseen) {
      out.high = std::numeric_limits<double>::infinity();
      out.low = positive ? 0.0 : -out.high;
    } else if (positive && quantile_ * deviation < out.value) {
      const double factor = std::exp(quantile_ * deviation / out.value);
      out.low = out.value / factor, out.high = out.value * factor;
    } else {
      out.low = out.value - quantile_ * deviation, out.high = out.value + quantile_ * deviation;
      if (positive) out.low = std::max(out.low, 0.0);
    }
    return out;
  }

  const detail::ServoInformation& information() const { return information_; }

 private:
  detail::ServoInformation information_;
  ServoJoint joint_;
  const ServoProblem& problem_;
  double quantile_;
};

bool has(const Parameters& free, P p) { return std::count(free.begin(), free.end(), p) > 0; }

const char* name_of(P p, bool si) {
  switch (p) {
    case P::inertia:
      return si ? "rotor_inertia" : "natural_frequency";
    case P::damping:
      return si ? "kd" : "damping_ratio";
    case P::coulomb:
      return si ? "coulomb" : "coulomb_position";
    case P::bias:
      return "bias";
    case P::delay:
      return "delay";
    case P::stribeck:
      return "stribeck_position";
    case P::stribeck_velocity:
      return "stribeck_velocity";
    case P::load_friction:
      return "load_friction";
    case P::compliance:
      return "kp";
    case P::limit:
      return si ? "torque_limit" : "error_limit";
    case P::command_lag:
      return "command_time_constant";
    case P::backlash:
      return "backlash";
    case P::gravity_compensation:
      return "gravity_compensation";
    case P::spring:
      return "spring";
  }
  return "";
}

void report(ServoFit& fit, const JointSearch& search, double confidence) {
  const Intervals intervals(search, confidence);
  const Parameters& free = search.free();
  fit.si = has(free, P::compliance) && fit.ratios.compliance > 0.0;
  const auto add = [&](const char* name, const char* unit, bool positive, auto f) {
    fit.values.push_back(intervals.value(name, unit, positive, f));
  };
  if (fit.si) {
    add("kp", "N m/rad", true, [](const ServoJoint& s) { return 1.0 / s.compliance; });
    add("kd", "N m s/rad", true, [](const ServoJoint& s) { return s.damping / s.compliance; });
    add("rotor_inertia", "kg m^2", true, [](const ServoJoint& s) { return s.inertia / s.compliance; });
    add("coulomb", "N m", true, [](const ServoJoint& s) { return s.coulomb / s.compliance; });
  } else {
    add("natural_frequency", "rad/s", true, [](const ServoJoint& s) { return 1.0 / std::sqrt(s.inertia); });
    add("damping_ratio", "1", true,
        [](const ServoJoint& s) { return 0.5 * s.damping / std::sqrt(s.inertia); });
    add("coulomb_position", "rad", true, [](const ServoJoint& s) { return s.coulomb; });
  }
  add("delay", "s", true, [](const ServoJoint& s) { return s.delay; });
  add("bias", "rad", false, [](const ServoJoint& s) { return s.bias; });
  if (has(free, P::stribeck)) {
    add("stribeck_position", "rad", true, [](const ServoJoint& s) { return s.stribeck; });
    add("stribeck_velocity", "rad/s", true, [](const ServoJoint& s) { return s.stribeck_velocity; });
  }
  if (has(free, P::load_friction))
    add("load_friction", "1", true, [](const ServoJoint& s) { return s.load_friction; });
  if (has(free, P::limit)) {
    if (fit.si)
      add("torque_limit", "N m", true, [](const ServoJoint& s) { return s.limit / s.compliance; });
    else
      add("error_limit", "rad", true, [](const ServoJoint& s) { return s.limit; });
  }
  if (has(free, P::command_lag))
    add("command_time_constant", "s", true, [](const ServoJoint& s) { return s.command_lag; });

  // What the motion does not tell apart, measured; and what no motion can.
  const Eigen::MatrixXd& H = intervals.information().hessian;
  const Eigen::MatrixXd inverse = H.completeOrthogonalDecomposition().pseudoInverse();
  const Parameters& seen = intervals.information().free;
  for (Eigen::Index i = 0; i < H.rows(); ++i)
    for (Eigen::Index k = 0; k < i; ++k) {
      const double r = inverse(i, k) / std::sqrt(inverse(i, i) * inverse(k, k));
      // Of a parameter that is not seen it is no number, infinite, or beyond 1 by what rounding leaves of it.
      if (std::abs(r) > alias_correlation && std::abs(r) < 1.0 + 1e-9)
        fit.aliases.push_back({name_of(seen[static_cast<std::size_t>(k)], fit.si),
                               name_of(seen[static_cast<std::size_t>(i)], fit.si), r});
    }
  fit.aliases.push_back({fit.si ? "kd" : "damping_ratio", "viscous", 0.0});
  if (!fit.si) fit.aliases.push_back({"bias", "gravity", 0.0});

  const detail::ServoBounds inertia = detail::servo_bounds(P::inertia, search.problem());
  if (!fit.si && fit.ratios.inertia < 4.0 * inertia.low)
    fit.remarks.emplace_back(
        "the response is of first order at this sampling rate: the natural frequency is a lower limit");
  const double earlier = search.earlier_command();
  if (earlier > 0.0) {
    std::ostringstream text;
    text.precision(3);
    text << "the motion would fit better if its command came " << earlier
         << " s earlier: the commands' stamps may be late";
    fit.remarks.push_back(text.str());
  }
  if (fit.ratios.coulomb <= 0.0 && fit.ratios.stribeck <= 0.0)
    fit.remarks.emplace_back("no dry friction was seen");
}

/// The joint's servo and what goes with it; what it replaces in the robot is in its ratios.
void put(Joint& joint, const ServoFit& fit) {
  const ServoJoint& r = fit.ratios;
  Servo servo;
  joint.friction = {};
  if (fit.si) {
    servo.kp = 1.0 / r.compliance;
    servo.kd = r.damping * servo.kp;
    joint.friction.linear.coulomb = r.coulomb * servo.kp;
    joint.rotor_inertia = r.inertia * servo.kp;
    servo.torque_limit = r.limit * servo.kp;
  } else {
    servo.natural_frequency = 1.0 / std::sqrt(r.inertia);
    servo.damping_ratio = 0.5 * r.damping * servo.natural_frequency;
    servo.coulomb_position = r.coulomb;
    servo.error_limit = r.limit;
    joint.rotor_inertia = 0.0;
  }
  servo.delay = r.delay;
  servo.bias = r.bias;
  servo.load_friction = r.load_friction;
  servo.command_time_constant = r.command_lag;
  if (r.stribeck > 0.0) {
    servo.stribeck_position = r.stribeck;
    servo.stribeck_velocity = r.stribeck_velocity;
  }
  joint.servo = servo;
}

Robot joints_alone(int n) {
  Robot robot;
  robot.name = "servos";
  for (int j = 1; j <= n; ++j)
    robot.joints.push_back(make_joint("joint" + std::to_string(j), JointType::continuous, {}));
  return robot;
}

}  // namespace

ServoIdentification identify_servos(const std::vector<Log>& logs, const std::optional<Robot>& robot,
                                    const ServoOptions& options) {
  ServoIdentification out;
  detail::check_servo_logs(logs, robot, out.issues);
  const int n = logs.front().joints();
  out.robot = robot ? *robot : joints_alone(n);
  if (options.progress) options.progress("preparing the logs", 0.0);
  const std::vector<std::vector<ServoSeries>> series = detail::servo_series(logs, robot);
  out.joints.resize(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) {
    out.joints[static_cast<std::size_t>(j)].joint = j + 1;
    out.joints[static_cast<std::size_t>(j)].name = out.robot.joints[static_cast<std::size_t>(j)].name;
  }
  std::mutex mutex;
  int done = 0;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, static_cast<std::size_t>(n), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          ServoFit& fit = out.joints[j];
          JointSearch search(series[j], options);
          if (search.scale().moves) {
            search.run(fit);
            report(fit, search, options.confidence);
          } else {
            fit.remarks.emplace_back("its command never moves: nothing is identified");
          }
          const std::lock_guard<std::mutex> lock(mutex);
          ++done;
          if (options.progress) options.progress("identifying servos", double(done) / n);
        }
      },
      tbb::simple_partitioner());
  bool any = false;
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    if (!out.joints[j].identified) continue;
    any = true;
    put(out.robot.joints[j], out.joints[j]);
  }
  if (!any) throw Error(logs.front().source + ": no command moves in any log: no servo can be identified");
  return out;
}

}  // namespace dynid
