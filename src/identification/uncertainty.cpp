// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/uncertainty.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/estimation/torque_estimator.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {
namespace {

constexpr std::array<double, 4> bandwidths = {280.0, 140.0, 70.0, 35.0};
// [1/s] In these the noise (the fast ones) and the model's error (the slow ones) are told apart.
constexpr std::array<double, 5> noise_windows = {140.0, 70.0, 35.0, 12.0, 4.0};
constexpr double variance_window = 12.0;  // [1/s]
constexpr double shortest_data = 5.0;     // [s]
constexpr double coarsest = 0.01;         // [s] between rows: coarser, the fast windows hold no sample
constexpr int folds = 4;
constexpr double part_constant = 0.25;  // of the mean variance

/// What the loop sees, one row a sample that is not a repeat; matrices N x n.
struct Residuals {
  Eigen::VectorXd dt;
  Eigen::MatrixXd external, dq, tau, ddq;
};

Residuals residuals_of(const HeldOutLog& part) {
  const Log& log = part.log;
  const int n = part.robot.size();
  if (log.t.size() == 0 || log.dq.size() == 0 || log.tau.size() == 0)
    throw Error(log.source + ": t, dq and tau are needed to learn how far the residual strays");
  if (log.joints() != n) throw Error(log.source + ": another number of joints than the robot's");
  TorqueEstimator<> estimator(TorqueModel<>(part.robot, Uncompensated::ignore));
  Residuals out;
  out.dt.resize(log.samples());
  for (Eigen::MatrixXd* x : {&out.external, &out.dq, &out.tau, &out.ddq}) x->resize(log.samples(), n);
  Eigen::Index rows = 0;
  double last = log.t[0];
  for (Eigen::Index k = 0; k < log.samples(); ++k) {
    const Estimate<>& e = estimator.step(k > 0 ? log.t[k] - log.t[k - 1] : 0.0, log.q.row(k).transpose(),
                                         log.dq.row(k).transpose(), log.tau.row(k).transpose());
    if (has(e.status, Status::bad_input | Status::stale)) continue;
    const double dt = log.t[k] - last;
    last = log.t[k];
    if (has(e.status, Status::restarted)) continue;
    out.dt[rows] = dt;
    out.external.row(rows) = e.external.transpose();
    out.dq.row(rows) = log.dq.row(k);
    out.tau.row(rows) = e.tau_model.transpose();
    out.ddq.row(rows) = e.ddq.transpose();
    ++rows;
  }
  out.dt.conservativeResize(rows);
  for (Eigen::MatrixXd* x : {&out.external, &out.dq, &out.tau, &out.ddq}) x->conservativeResize(rows, n);
  return out;
}

/// A column through the two poles of a window, as ContactTest has them.
Eigen::VectorXd windowed(const Eigen::VectorXd& dt, const Eigen::VectorXd& x, double bandwidth) {
  Eigen::VectorXd out(x.size());
  double one = 0.0, two = 0.0;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double step = bandwidth * dt[k], share = step / (1.0 + step);
    one += share * (x[k] - one);
    two += share * (one - two);
    out[k] = two;
  }
  return out;
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

/// The part of the model error's variance that a window passes.
double passed(double bandwidth, double correlation_time) {
  const double x = bandwidth * correlation_time;
  return x / (2.0 + x);
}

/// momentum_noise, correlation_time; returns the mean of sigma^2.
double noise_and_time(const std::vector<Residuals>& parts, Eigen::Index joint, JointUncertainty& u) {
  const std::array<double, noise_windows.size()> w = noise_windows;
  std::array<double, noise_windows.size()> variance{};
  for (std::size_t b = 0; b < w.size(); ++b) {
    double sum = 0.0, count = 0.0;
    for (const Residuals& part : parts) {
      sum += windowed(part.dt, part.external.col(joint), w[b]).squaredNorm();
      count += static_cast<double>(part.dt.size());
    }
    variance[b] = std::max(sum / count, 1e-12);
  }
  double best = std::numeric_limits<double>::infinity(), mean = variance.back();
  for (double T = 0.01; T < 3.0; T *= 1.4) {
    Eigen::MatrixXd A(w.size(), 2);
    for (std::size_t b = 0; b < w.size(); ++b)
      A.row(static_cast<Eigen::Index>(b)) << 0.25 * w[b] * w[b] * w[b] / variance[b],
          passed(w[b], T) / variance[b];
    const Eigen::VectorXd one = Eigen::VectorXd::Ones(A.rows());
    const Eigen::VectorXd scale = A.colwise().norm();
    const Eigen::VectorXd x =
        nonnegative_least_squares(A * scale.cwiseInverse().asDiagonal(), one).cwiseQuotient(scale);
    const double error = (A * x - one).squaredNorm();
    if (error < best) {
      best = error;
      u.momentum_noise = x[0], u.correlation_time = T;
      mean = x[1];
    }
  }
  return std::max(mean, 1e-3 * variance.back());
}

/// The coefficients of sigma^2.
void fit_variance(const std::vector<Residuals>& parts, Eigen::Index joint, double mean, JointUncertainty& u) {
  constexpr Eigen::Index stride = 10;
  const double w = variance_window, noise = 0.25 * u.momentum_noise * w * w * w;
  const double share = passed(w, u.correlation_time);
  std::vector<std::array<double, 6>> rows;
  for (const Residuals& part : parts) {
    const Eigen::VectorXd r = windowed(part.dt, part.external.col(joint), w);
    for (Eigen::Index k = 0; k < r.size(); k += stride) {
      const double v = part.dq(k, joint), s = v / u.stiction_speed;
      rows.push_back({1.0, v * v, 1.0 / (1.0 + s * s), part.tau(k, joint) * part.tau(k, joint),
                      part.ddq(k, joint) * part.ddq(k, joint), r[k] * r[k]});
    }
  }
  const Eigen::Index count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd A(count, 5);
  Eigen::VectorXd b(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    for (Eigen::Index f = 0; f < 5; ++f)
      A(k, f) = rows[static_cast<std::size_t>(k)][static_cast<std::size_t>(f)];
    // What is left beside the noise and the constant part, as sigma^2.
    b[k] = (rows[static_cast<std::size_t>(k)][5] - noise) / share - part_constant * mean;
  }
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-12);
  A = A * scale.cwiseInverse().asDiagonal();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(5), weight = Eigen::VectorXd::Ones(count);
  for (int pass = 0; pass < 6; ++pass) {
    x = nonnegative_least_squares(weight.asDiagonal() * A, weight.cwiseProduct(b));
    // The square of a normal variable strays as much as its variance.
    weight = (((A * x).array() + part_constant * mean) * share + noise).inverse() * mean;
  }
  x = x.cwiseQuotient(scale);
  u.constant = x[0] + part_constant * mean;
  u.speed = x[1], u.stiction = x[2], u.load = x[3], u.acceleration = x[4];
}

/// The tail of block maxima above their 60 % quantile.
ContactWindow tail(double bandwidth, const std::vector<double>& maxima, double block) {
  std::vector<WeightedSample> samples;
  for (double x : maxima) samples.push_back({x, 1.0});
  ContactWindow out;
  out.bandwidth = bandwidth;
  out.level = std::max(quantile(samples, 0.6), 1e-6);
  double sum = 0.0, count = 0.0;
  for (double x : maxima)
    if (x > out.level) sum += x - out.level, count += 1.0;
  if (count < 5.0) throw Error("too few independent stretches to learn how far the residual strays");
  out.scale = std::max(sum / count * (1.0 + 1.0 / std::sqrt(count)), 1e-6);
  out.per_hour = 3600.0 * count / (static_cast<double>(maxima.size()) * block);
  return out;
}

std::vector<ContactWindow> learn_windows(const std::vector<Residuals>& parts,
                                         const std::vector<JointUncertainty>& joints) {
  const int n = static_cast<int>(joints.size());
  Uncertainty open;  // thresholds that are never passed
  open.joints = joints;
  for (double w : bandwidths) open.windows.push_back({w, 1e12, 1.0, 1.0});
  const auto tuning = ContactTest<>::make_tuning(open, n, {});
  std::array<std::vector<double>, bandwidths.size()> maxima;
  for (const Residuals& part : parts) {
    ContactTest<> test(n);
    std::array<double, bandwidths.size()> largest{}, elapsed{};
    double t = 0.0;
    for (Eigen::Index k = 0; k < part.dt.size(); ++k) {
      test.update(part.dt[k], part.external.row(k).transpose(), part.dq.row(k).transpose(),
                  part.tau.row(k).transpose(), part.ddq.row(k).transpose(), tuning);
      t += part.dt[k];
      for (std::size_t b = 0; b < bandwidths.size(); ++b) {
        if (t * bandwidths[b] < 2.0) continue;
        largest[b] = std::max(largest[b], test.statistic(b));
        if ((elapsed[b] += part.dt[k]) < 4.0 / bandwidths[b]) continue;
        maxima[b].push_back(largest[b]);
        largest[b] = elapsed[b] = 0.0;
      }
    }
  }
  std::vector<ContactWindow> windows;
  for (std::size_t b = 0; b < bandwidths.size(); ++b)
    windows.push_back(tail(bandwidths[b], maxima[b], 4.0 / bandwidths[b]));
  return windows;
}

/// Where pushes are looked for: centres of mass, where a body can have them there, and the tip.
Eigen::Vector3d contact_point(const Robot& robot, std::size_t link) {
  if (link + 1 == robot.joints.size()) return robot.tip.translation();
  double reach = robot.tip.translation().norm();
  for (const Joint& joint : robot.joints) reach = std::max(reach, joint.origin.translation().norm());
  const StandardParameters& p = robot.joints[link].parameters;
  const Eigen::Vector3d com = p[0] > 0.0 ? Eigen::Vector3d(p.segment<3>(1) / p[0]) : Eigen::Vector3d::Zero();
  if (p[0] > 0.0 && com.norm() <= reach) return com;
  return 0.5 * robot.joints[link + 1].origin.translation();
}

Log rows_of_log(const Log& log, Eigen::Index first, Eigen::Index count) {
  Log out = log;
  if (log.t.size() > 0) out.t = log.t.segment(first, count).eval();
  for (Eigen::MatrixXd Log::*x :
       {&Log::q, &Log::dq, &Log::tau, &Log::ddq, &Log::tau_cmd, &Log::theta, &Log::temp, &Log::u, &Log::i})
    if ((log.*x).rows() > 0) out.*x = (log.*x).middleRows(first, count).eval();
  return out;
}

}  // namespace

Uncertainty learn_uncertainty(const std::vector<HeldOutLog>& parts) {
  if (parts.empty()) throw Error("no log to learn from how far the residual strays");
  const Robot& robot = parts.front().robot;
  std::vector<Residuals> residuals;
  Uncertainty out;
  Eigen::Index rows = 0;
  for (const HeldOutLog& part : parts) {
    if (part.robot.size() != robot.size()) throw Error("robots of different sizes");
    residuals.push_back(residuals_of(part));
    out.seconds += residuals.back().dt.sum();
    rows += residuals.back().dt.size();
  }
  const std::string& source = parts.front().log.source;
  if (out.seconds < shortest_data)
    throw Error(source + ": less than 5 s to learn from how far the residual strays");
  if (out.seconds > coarsest * static_cast<double>(rows))
    throw Error(source + ": rows further apart than 10 ms do not show how far the residual strays");
  for (int j = 0; j < robot.size(); ++j) {
    JointUncertainty u;
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (joint.friction.linear.velocity_scale > 0.0) u.stiction_speed = joint.friction.linear.velocity_scale;
    const double v = 3.0 * u.stiction_speed;
    const double step = friction_torque(joint.friction, v) - friction_torque(joint.friction, -v);
    u.sticking = std::max(0.0, 0.5 * step - joint.friction.linear.viscous * v);
    u.contact_point = contact_point(robot, static_cast<std::size_t>(j));
    fit_variance(residuals, j, noise_and_time(residuals, j, u), u);
    out.joints.push_back(u);
  }
  out.windows = learn_windows(residuals, out.joints);
  validate(out, robot.size());
  return out;
}

Uncertainty identify_uncertainty(const Robot& robot, const Robot& identified, const std::vector<Log>& logs,
                                 const std::vector<Log>& validation, const IdentifyOptions& options) {
  std::vector<HeldOutLog> parts;
  for (const Log& log : validation) parts.push_back({identified, log});
  IdentifyOptions quiet = options;
  quiet.validate = false;
  quiet.progress = nullptr;
  for (int fold = 0; validation.empty() && fold < folds; ++fold) {
    std::vector<Log> rest, out;
    for (const Log& log : logs) {
      const Eigen::Index N = log.samples(), a = N * fold / folds, b = N * (fold + 1) / folds;
      if (a > 0) rest.push_back(rows_of_log(log, 0, a));
      if (b < N) rest.push_back(rows_of_log(log, b, N - b));
      out.push_back(rows_of_log(log, a, b - a));
    }
    const Robot fitted = identify(robot, rest, {}, quiet).robot;
    for (Log& log : out) parts.push_back({fitted, std::move(log)});
  }
  Uncertainty learnt = learn_uncertainty(parts);
  for (std::size_t i = 0; i < learnt.joints.size(); ++i)
    learnt.joints[i].contact_point = contact_point(robot, i);
  return learnt;
}

}  // namespace dynid
