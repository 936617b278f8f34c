// SPDX-License-Identifier: Apache-2.0
#include "spread_rows.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace dynid::detail {
namespace {

constexpr Eigen::Index least_window = 9;  // samples, for a cubic
/// Half a window times the quickest frequency of the motion: a cubic then errs by some 3 % in the
/// acceleration.
constexpr double phase_of_window = 0.6;
constexpr double top_of_spectrum = 2.5;  // highest frequency that matters, in multiples of rms(dq) / rms(q)
constexpr double moving = 0.05;  // of the widest travel: a joint below it says nothing about frequency

double median_interval(const Eigen::VectorXd& t) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) steps.push_back(t[i] - t[i - 1]);
  if (steps.empty()) return 0.0;
  std::nth_element(steps.begin(), steps.begin() + steps.size() / 2, steps.end());
  return steps[steps.size() / 2];
}

/// rms(dq) / rms(q) of the quickest joint that moves [1 / unit of time].
double motion_frequency(const Log& log, const Eigen::VectorXd& travel) {
  const Eigen::Index N = log.samples(), stride = std::max<Eigen::Index>(1, N / 3000);
  double most = 0.0;
  for (int j = 0; j < log.joints(); ++j) {
    if (travel[j] < moving * travel.maxCoeff() || travel[j] == 0.0) continue;
    const double mean = log.q.col(j).mean();
    double speed = 0.0, swing = 0.0, steps = 0.0;
    for (Eigen::Index i = stride; i < N; i += stride) {
      const double dt = log.t[i] - log.t[i - stride];
      if (!(dt > 0.0)) continue;
      const double v = (log.q(i, j) - log.q(i - stride, j)) / dt, x = log.q(i, j) - mean;
      speed += v * v;
      swing += x * x;
      steps += 1.0;
    }
    if (swing > 0.0 && steps > 0.0) most = std::max(most, std::sqrt(speed / swing));
  }
  return most;
}

/// Samples at equal steps of the way travelled (all joints, each by its travel), half of it by time.
std::vector<Eigen::Index> centres(const Log& log, const Eigen::VectorXd& travel, Eigen::Index count) {
  const Eigen::Index N = log.samples();
  Eigen::VectorXd way = Eigen::VectorXd::Zero(N);
  for (Eigen::Index i = 1; i < N; ++i) {
    double step = 0.0;
    for (int j = 0; j < log.joints(); ++j)
      if (travel[j] > 0.0) step += std::abs(log.q(i, j) - log.q(i - 1, j)) / travel[j];
    way[i] = way[i - 1] + step;
  }
  const double total = std::max(way[N - 1], 1e-300), part = 1.0 / double(N - 1);
  std::vector<Eigen::Index> found;
  double next = 0.5 / double(count);
  for (Eigen::Index i = 0; i < N; ++i) {
    if (0.5 * (way[i] / total + double(i) * part) < next) continue;
    found.push_back(i);
    while (next <= 0.5 * (way[i] / total + double(i) * part)) next += 1.0 / double(count);
  }
  return found;
}

/// Value, slope and curvature at `tc` of the cubic through samples [a, b), each by its nearness to tc.
/// False where the samples do not carry one.
bool cubic_weights(const Eigen::VectorXd& t, Eigen::Index a, Eigen::Index b, double tc, double half,
                   Eigen::Matrix3Xd& out) {
  Eigen::Matrix4d G = Eigen::Matrix4d::Zero();
  Eigen::Matrix4Xd basis(4, b - a);
  for (Eigen::Index i = a; i < b; ++i) {
    const double x = (t[i] - tc) / half, w = 1.0 - 0.9 * std::min(1.0, x * x);
    const Eigen::Vector4d p(1.0, x, x * x, x * x * x);
    G += w * p * p.transpose();
    basis.col(i - a) = w * p;
  }
  const Eigen::LDLT<Eigen::Matrix4d> factor(G);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 1e-9 * factor.vectorD().maxCoeff()))
    return false;
  const Eigen::Matrix4Xd weights = factor.solve(basis);
  out.resize(3, b - a);
  out << weights.row(0), weights.row(1) / half, 2.0 * weights.row(2) / (half * half);
  return out.allFinite();
}

}  // namespace

SpreadRows spread_rows(const std::vector<Log>& logs, Eigen::Index count) {
  SpreadRows rows;
  double samples = 0.0;
  bool tau = true, dq = true;
  for (const Log& log : logs) {
    samples += double(log.samples());
    tau = tau && log.tau.rows() == log.samples();
    dq = dq && log.dq.rows() == log.samples();
  }
  const int n = logs.empty() ? 0 : logs.front().joints();
  std::vector<Eigen::RowVectorXd> all;  // q, dq, ddq, tau, logged_dq side by side
  for (const Log& log : logs) {
    const Eigen::Index N = log.samples();
    if (N < least_window || log.t.size() != N || log.joints() != n) continue;
    const double interval = median_interval(log.t);
    if (!(interval > 0.0)) continue;
    rows.interval = std::max(rows.interval, interval);
    const Eigen::VectorXd travel = (log.q.colwise().maxCoeff() - log.q.colwise().minCoeff()).transpose();
    const double frequency = motion_frequency(log, travel);
    double half = 0.5 * double(least_window) * interval;
    if (frequency > 0.0) half = std::max(half, phase_of_window / (top_of_spectrum * frequency));
    half = std::min(half, 0.1 * (log.t[N - 1] - log.t[0]));
    const auto share = std::max<Eigen::Index>(8, std::lround(double(count) * double(N) / samples));
    Eigen::Matrix3Xd weights;
    for (const Eigen::Index centre : centres(log, travel, share)) {
      const double tc = std::clamp(log.t[centre], log.t[0] + half, log.t[N - 1] - half);
      const double* begin = log.t.data();
      const Eigen::Index a = std::lower_bound(begin, begin + N, tc - half) - begin,
                         b = std::upper_bound(begin, begin + N, tc + half) - begin;
      if (double(b - a) < std::max(5.0, half / interval)) continue;  // a gap in the log
      if (!cubic_weights(log.t, a, b, tc, half, weights)) continue;
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(5 * n);
      const Eigen::MatrixXd motion = weights * log.q.middleRows(a, b - a);
      row.head(3 * n) << motion.row(0), motion.row(1), motion.row(2);
      if (tau) row.segment(3 * n, n) = weights.row(0) * log.tau.middleRows(a, b - a);
      if (dq) row.segment(4 * n, n) = weights.row(0) * log.dq.middleRows(a, b - a);
      all.push_back(row);
    }
  }
  const auto M = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd table(M, 5 * n);
  // Steps of the golden section visit every row once and leave no stretch out for long.
  Eigen::Index step = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(0.6180339887 * double(M)));
  while (M > 1 && std::gcd(step, M) != 1) ++step;
  for (Eigen::Index i = 0, at = 0; i < M; ++i, at = (at + step) % M)
    table.row(i) = all[static_cast<std::size_t>(at)];
  rows.q = table.leftCols(n);
  rows.dq = table.middleCols(n, n);
  rows.ddq = table.middleCols(2 * n, n);
  if (tau) rows.tau = table.middleCols(3 * n, n);
  if (dq) rows.logged_dq = table.middleCols(4 * n, n);
  return rows;
}

}  // namespace dynid::detail
