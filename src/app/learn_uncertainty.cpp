// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/learn_uncertainty.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/estimation/torque_estimator.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {
namespace {

constexpr std::array<double, 4> motion_bandwidths = {25.0, 50.0, 100.0, 200.0};  // [1/s]
constexpr double shortest_data = 5.0;                                            // [s]
constexpr double coarsest = 0.01;  // [s] between rows: coarser, the window holds no sample
constexpr int folds = 8;
constexpr double lead = 0.5;            // [s] of rows before a fold that fill its filters
constexpr double part_constant = 0.25;  // of the mean variance
constexpr double slow = 0.1;            // of a joint's rms speed: its stiction zone
constexpr double block = 8.0;           // windows that a maximum of the statistic is taken over
constexpr double tail_from = 0.6;       // quantile of the maxima above which they are the tail
// Alarms differ from one stretch of 10 s to the next: at most so many times as many as the log's own tail
// says come in 95 % of them (80 halves of simulated arms, at 1200 an hour).
constexpr double bunching = 5.0;
constexpr double out_of_reach = 1e300;

/// What the loop sees, one row a sample in use; matrices N x n. Only rows beyond lead and settling.
struct Residuals {
  Eigen::VectorXd dt, statistic;
  Eigen::MatrixXd residual, dq, tau, ddq;
};

Residuals residuals_of(const HeldOutLog& part, const Uncertainty& uncertainty) {
  const Log& log = part.log;
  const int n = part.robot.size();
  TorqueEstimatorOptions options;
  options.uncertainty = uncertainty;
  options.uncertainty->tail = {out_of_reach, 1.0, 1.0};
  TorqueEstimator<> estimator(TorqueModel<>(part.robot, Uncompensated::ignore), options);
  const double settling = 10.0 / std::min(uncertainty.window, uncertainty.motion_bandwidth);
  Residuals out;
  out.dt.resize(log.samples()), out.statistic.resize(log.samples());
  for (Eigen::MatrixXd* x : {&out.residual, &out.dq, &out.tau, &out.ddq}) x->resize(log.samples(), n);
  Eigen::Index rows = 0;
  double last = log.t[0], since = 0.0;
  for (Eigen::Index k = 0; k < log.samples(); ++k) {
    const Estimate<>& e = estimator.step(k > 0 ? log.t[k] - log.t[k - 1] : 0.0, log.q.row(k).transpose(),
                                         log.dq.row(k).transpose(), log.tau.row(k).transpose());
    if (has(e.status, Status::bad_input | Status::stale)) continue;
    const double dt = log.t[k] - last;
    last = log.t[k];
    since = has(e.status, Status::restarted) ? 0.0 : since + dt;
    if (since <= settling || k < part.lead) continue;
    out.dt[rows] = dt;
    out.statistic[rows] = e.pushed.statistic;
    out.residual.row(rows) = e.pushed.residual.transpose();
    out.dq.row(rows) = e.dq.transpose();
    out.tau.row(rows) = e.tau_model.transpose();
    out.ddq.row(rows) = e.ddq.transpose();
    ++rows;
  }
  out.dt.conservativeResize(rows), out.statistic.conservativeResize(rows);
  for (Eigen::MatrixXd* x : {&out.residual, &out.dq, &out.tau, &out.ddq}) x->conservativeResize(rows, n);
  return out;
}

std::vector<Residuals> residuals_of(const std::vector<HeldOutLog>& parts, const Uncertainty& uncertainty) {
  std::vector<Residuals> out;
  for (const HeldOutLog& part : parts) out.push_back(residuals_of(part, uncertainty));
  return out;
}

/// What is between two rows of a log whose positions differ.
struct Step {
  double stamp;                 ///< [s] by the stamps
  double speed, along;          ///< |dq|^2; [s] by the motion along dq
  Eigen::VectorXd q, velocity;  ///< difference, mean
};

std::vector<Step> steps_of(const std::vector<HeldOutLog>& parts) {
  std::vector<Step> steps;
  for (const HeldOutLog& part : parts) {
    const Log& log = part.log;
    Eigen::Index last = 0;
    for (Eigen::Index k = 1; k < log.samples(); ++k) {
      if (log.q.row(k) == log.q.row(last) || !(log.t[k] > log.t[last])) continue;
      Step step;
      step.stamp = log.t[k] - log.t[last];
      step.q = (log.q.row(k) - log.q.row(last)).transpose();
      step.velocity = 0.5 * (log.dq.row(k) + log.dq.row(last)).transpose();
      step.speed = step.velocity.squaredNorm();
      step.along = step.q.dot(step.velocity) / std::max(step.speed, 1e-300);
      steps.push_back(std::move(step));
      last = k;
    }
  }
  return steps;
}

/// period and position_noise, from the faster half of the steps.
void learn_clock(const std::vector<HeldOutLog>& parts, Uncertainty& out) {
  std::vector<Step> steps = steps_of(parts);
  if (steps.size() < 100) throw Error(parts.front().log.source + ": the arm hardly moves");
  std::vector<double> stamps, speeds, off, noise;
  for (const Step& step : steps) stamps.push_back(step.stamp), speeds.push_back(step.speed);
  const double fast = median(speeds);
  steps.erase(
      std::remove_if(steps.begin(), steps.end(), [fast](const Step& step) { return step.speed < fast; }),
      steps.end());
  double period = median(stamps);
  for (int pass = 0; pass < 3; ++pass) {  // the stamps' jitter ends in their sum
    double time = 0.0, periods = 0.0;
    for (const Step& step : steps) time += step.stamp, periods += std::round(step.along / period);
    if (periods > 0.5 * static_cast<double>(steps.size())) period = time / periods;
  }
  for (const Step& step : steps)
    off.push_back(std::abs(step.along / period - std::round(step.along / period)));
  if (median(off) < 0.1) out.period = period;
  for (const Step& step : steps) {
    const double dt = out.period > 0.0 ? period * std::round(step.along / period) : step.stamp;
    const Eigen::VectorXd error = step.q - dt * step.velocity;
    for (double x : error) noise.push_back(std::abs(x));
  }
  out.position_noise = std::max(median(noise) * deviations_to_sigma / std::sqrt(2.0), 1e-9);
}

/// x >= 0 that minimises |A x - b|, by coordinates.
Eigen::VectorXd nonnegative_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  const Eigen::MatrixXd H = A.transpose() * A;
  const Eigen::VectorXd g = A.transpose() * b;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(g.size());
  for (int sweep = 0; sweep < 500; ++sweep) {
    double moved = 0.0;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      if (!(H(k, k) > 0.0)) continue;
      const double next = std::max(0.0, x[k] + (g[k] - H.row(k).dot(x)) / H(k, k));
      moved = std::max(moved, std::abs(next - x[k]) * std::sqrt(H(k, k)));
      x[k] = next;
    }
    if (moved <= 1e-9 * b.norm()) break;
  }
  return x;
}

/// The coefficients of sigma^2.
void fit_variance(const std::vector<Residuals>& parts, Eigen::Index joint, JointUncertainty& u) {
  constexpr Eigen::Index stride = 10;
  std::vector<std::array<double, 6>> rows;
  double mean = 0.0;
  for (const Residuals& part : parts)
    for (Eigen::Index k = 0; k < part.dt.size(); k += stride) {
      const double v = part.dq(k, joint), s = v / u.stiction_speed, r = part.residual(k, joint);
      rows.push_back({1.0, v * v, 1.0 / (1.0 + s * s), part.tau(k, joint) * part.tau(k, joint),
                      part.ddq(k, joint) * part.ddq(k, joint), r * r});
      mean += r * r;
    }
  const Eigen::Index count = static_cast<Eigen::Index>(rows.size());
  mean = std::max(mean / static_cast<double>(count), 1e-300);
  Eigen::MatrixXd A(count, 5);
  Eigen::VectorXd b(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    for (Eigen::Index f = 0; f < 5; ++f)
      A(k, f) = rows[static_cast<std::size_t>(k)][static_cast<std::size_t>(f)];
    b[k] = rows[static_cast<std::size_t>(k)][5] - part_constant * mean;  // beside the constant part
  }
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300);
  A = A * scale.cwiseInverse().asDiagonal();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(5), weight = Eigen::VectorXd::Ones(count);
  for (int pass = 0; pass < 6; ++pass) {
    x = nonnegative_least_squares(weight.asDiagonal() * A, weight.cwiseProduct(b));
    // The square of a normal variable strays as much as its variance.
    weight = ((A * x).array() + part_constant * mean).inverse() * mean;
  }
  x = x.cwiseQuotient(scale);
  u.constant = x[0] + part_constant * mean;
  u.speed = x[1], u.stiction = x[2], u.load = x[3], u.acceleration = x[4];
}

Eigen::MatrixXd moments(const std::vector<Residuals>& parts, const std::vector<JointUncertainty>* scaled_by) {
  const Eigen::Index n = parts.front().residual.cols();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
  double count = 0.0;
  for (const Residuals& part : parts)
    for (Eigen::Index k = 0; k < part.dt.size(); ++k) {
      Eigen::VectorXd z = part.residual.row(k).transpose();
      for (Eigen::Index i = 0; scaled_by != nullptr && i < n; ++i)
        z[i] /= std::sqrt((*scaled_by)[static_cast<std::size_t>(i)].variance(part.dq(k, i), part.tau(k, i),
                                                                             part.ddq(k, i)));
      sum += z * z.transpose();
      count += 1.0;
    }
  return sum / count;
}

/// 1 on the diagonal; a hundredth of it is independent, so that no joint is certain from the others.
Eigen::MatrixXd correlation(const Eigen::MatrixXd& second) {
  const Eigen::VectorXd d = second.diagonal().cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd C = 0.99 * (d.asDiagonal() * second * d.asDiagonal());
  C = (0.5 * (C + C.transpose())).eval();
  C.diagonal().setOnes();
  return C;
}

ContactTail learn_tail(const std::vector<Residuals>& parts, double length) {
  std::vector<WeightedSample> maxima;
  for (const Residuals& part : parts) {
    double largest = 0.0, elapsed = 0.0;
    for (Eigen::Index k = 0; k < part.dt.size(); ++k) {
      largest = std::max(largest, part.statistic[k]);
      if ((elapsed += part.dt[k]) < length) continue;
      maxima.push_back({largest, 1.0});
      largest = elapsed = 0.0;
    }
  }
  if (maxima.size() < 20) throw Error("too few independent stretches to learn how far the residual strays");
  ContactTail out;
  out.level = std::max(quantile(maxima, tail_from), 1e-9);
  double sum = 0.0;
  for (const WeightedSample& x : maxima)
    if (x.value > out.level) sum += x.value - out.level, out.count += 1.0;
  if (out.count < 5.0) throw Error("too few independent stretches to learn how far the residual strays");
  out.scale = std::max(sum / out.count, 1e-9);
  out.per_hour = bunching * 3600.0 * out.count / (static_cast<double>(maxima.size()) * length);
  return out;
}

/// Where pushes are looked for: centres of mass, where a body can have them there, and the tip.
Eigen::Vector3d contact_point(const Robot& robot, std::size_t link) {
  if (link + 1 == robot.joints.size()) return robot.tip.translation();
  double reach = robot.tip.translation().norm();
  for (const Joint& joint : robot.joints) reach = std::max(reach, joint.origin.translation().norm());
  const StandardParameters& p = robot.joints[link].parameters;
  Eigen::Vector3d com = p[0] > 0.0 ? Eigen::Vector3d(p.segment<3>(1) / p[0]) : Eigen::Vector3d::Zero();
  if (p[0] > 0.0 && com.norm() <= reach) return com;
  return 0.5 * robot.joints[link + 1].origin.translation();
}

/// Where pushes are looked for and how likely on each link: its size, from its joint to the next, or to its
/// centre of mass where that is further; the last one meets the world with its tip, as often as the largest.
void set_contacts(const Robot& robot, std::vector<JointUncertainty>& joints) {
  double largest = 1e-9;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    joints[i].contact_point = contact_point(robot, i);
    const bool last = i + 1 == joints.size();
    const double length = (last ? robot.tip : robot.joints[i + 1].origin).translation().norm();
    joints[i].extent = std::max({length, joints[i].contact_point.norm(), 1e-9});
    largest = std::max(largest, joints[i].extent);
  }
  joints.back().extent = largest;
}

Log rows_of_log(const Log& log, Eigen::Index first, Eigen::Index count) {
  Log out = log;
  if (log.t.size() > 0) out.t = log.t.segment(first, count).eval();
  for (Eigen::MatrixXd Log::*x :
       {&Log::q, &Log::dq, &Log::tau, &Log::ddq, &Log::tau_cmd, &Log::theta, &Log::temp, &Log::u, &Log::i})
    if ((log.*x).rows() > 0) out.*x = (log.*x).middleRows(first, count).eval();
  return out;
}

void check(const std::vector<HeldOutLog>& parts) {
  if (parts.empty()) throw Error("no log to learn from how far the residual strays");
  double seconds = 0.0, rows = 0.0;
  for (const HeldOutLog& part : parts) {
    const Log& log = part.log;
    if (part.robot.size() != parts.front().robot.size()) throw Error("robots of different sizes");
    if (log.t.size() == 0 || log.dq.size() == 0 || log.tau.size() == 0)
      throw Error(log.source + ": t, dq and tau are needed to learn how far the residual strays");
    if (log.joints() != part.robot.size())
      throw Error(log.source + ": another number of joints than the robot's");
    seconds += log.t[log.samples() - 1] - log.t[0];
    rows += static_cast<double>(log.samples());
  }
  const std::string& source = parts.front().log.source;
  if (seconds < shortest_data)
    throw Error(source + ": less than 5 s to learn from how far the residual strays");
  if (seconds > coarsest * rows)
    throw Error(source + ": rows further apart than 10 ms do not show how far the residual strays");
}

}  // namespace

Uncertainty learn_uncertainty(const std::vector<HeldOutLog>& parts) {
  check(parts);
  const Robot& robot = parts.front().robot;
  const int n = robot.size();
  Uncertainty out;
  JointUncertainty plain;
  plain.constant = 1.0;
  out.joints.assign(static_cast<std::size_t>(n), plain);
  out.correlation = Eigen::MatrixXd::Identity(n, n);
  learn_clock(parts, out);
  std::vector<Residuals> residuals;
  double smallest = std::numeric_limits<double>::infinity();
  for (double bandwidth : motion_bandwidths) {
    Uncertainty next = out;
    next.motion_bandwidth = bandwidth;
    std::vector<Residuals> seen = residuals_of(parts, next);
    double seconds = 0.0;
    for (const Residuals& part : seen) seconds += part.dt.sum();
    if (seconds < 0.5 * shortest_data)
      throw Error(parts.front().log.source + ": less than 2.5 s of it are of use to the loop");
    const Eigen::MatrixXd second = moments(seen, nullptr);
    const double size = second.diagonal().array().max(1e-300).log().sum() +
                        std::log(std::max(correlation(second).determinant(), 1e-300));
    if (!(size < smallest)) continue;
    smallest = size;
    out.motion_bandwidth = bandwidth;
    out.seconds = seconds;
    residuals = std::move(seen);
  }
  if (residuals.empty()) throw Error(parts.front().log.source + ": a joint has no residual at all");
  for (int j = 0; j < n; ++j) {
    JointUncertainty& u = out.joints[static_cast<std::size_t>(j)];
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    double square = 0.0, count = 0.0;
    for (const Residuals& part : residuals)
      square += part.dq.col(j).squaredNorm(), count += static_cast<double>(part.dt.size());
    const double v = std::max(slow * std::sqrt(square / count), 1e-9);
    u.stiction_speed = v;
    const double step = friction_torque(joint.friction, v) - friction_torque(joint.friction, -v);
    u.sticking = std::max(0.0, 0.5 * step - joint.friction.linear.viscous * v);
    fit_variance(residuals, j, u);
  }
  set_contacts(robot, out.joints);
  out.correlation = correlation(moments(residuals, &out.joints));
  out.tail = {out_of_reach, 1.0, 1.0};
  out.tail = learn_tail(residuals_of(parts, out), block / out.window);
  validate(out, n);
  return out;
}

Uncertainty identify_uncertainty(const Robot& robot, const Robot& identified, const std::vector<Log>& logs,
                                 const std::vector<Log>& validation, const IdentifyOptions& options) {
  std::vector<HeldOutLog> parts;
  for (const Log& log : validation) parts.push_back({identified, log});
  constexpr auto stage = "learning how far the residual strays";
  if (options.progress) options.progress(stage, 0.0);
  std::vector<std::vector<HeldOutLog>> held(validation.empty() ? folds : 0);
  std::atomic<int> done{0};
  const auto learn = [&](int fold) {
    std::vector<Log> rest;
    std::vector<HeldOutLog>& out = held[static_cast<std::size_t>(fold)];
    for (const Log& log : logs) {
      const Eigen::Index N = log.samples(), a = N * fold / folds, b = N * (fold + 1) / folds;
      if (a > 0) rest.push_back(rows_of_log(log, 0, a));
      if (b < N) rest.push_back(rows_of_log(log, b, N - b));
      Eigen::Index before = a;
      while (log.t.size() > 0 && before > 0 && log.t[a] - log.t[before] < lead) --before;
      out.push_back({robot, rows_of_log(log, before, b - before), a - before});
    }
    IdentifyOptions quiet = options;
    quiet.validate = false;
    quiet.progress = [&](const std::string&, double) {  // a stop is seen here
      if (options.progress) options.progress(stage, double(done) / folds);
    };
    const Robot fitted = identify(robot, rest, {}, quiet).robot;
    for (HeldOutLog& part : out) part.robot = fitted;
    ++done;
  };
  tbb::parallel_for(0, static_cast<int>(held.size()), learn, tbb::simple_partitioner());
  for (std::vector<HeldOutLog>& fold : held)
    for (HeldOutLog& part : fold) parts.push_back(std::move(part));
  Uncertainty learnt = learn_uncertainty(parts);
  set_contacts(robot, learnt.joints);
  return learnt;
}

}  // namespace dynid
