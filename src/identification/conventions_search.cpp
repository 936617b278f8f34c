// SPDX-License-Identifier: Apache-2.0
// Readings of the whole log: signs and units of torques, sides of a gear, gravity.
#include <Eigen/Dense>
#include <cmath>
#include <numeric>

#include "conventions_search.hpp"
#include "dynid/dynamics/mass_matrix.hpp"

namespace dynid::detail {

using Eigen::Index;

Reading ConventionSearch::plain() const {
  Reading r;
  r.order.resize(n_);
  std::iota(r.order.begin(), r.order.end(), 0);
  r.sign = r.torque_sign = r.factor = Eigen::VectorXd::Ones(n_);
  r.zero = Eigen::VectorXd::Zero(n_);
  r.gravity = robot_.gravity;
  return r;
}

void ConventionSearch::run(const Reading& base) {
  before_ = judged(base, torque_of(full_, base, base.gravity));
  if (before_.left.maxCoeff() <= options_.read_well) return;
  Reading degrees = base;
  degrees.position_unit = degree_of_angle;
  degrees.complexity += 0.5;
  const std::array<Reading, 2> bases = {base, degrees};
  for (const Reading& r : bases) add_all(r);
  if (settled()) return;
  for (const Reading& r : bases) try_signs(r);
  if (settled()) return;
  for (const Reading& r : bases) try_zeros(r);
  for (const Reading& r : bases) {
    if (settled()) return;
    try_orders(r);
  }
  if (settled()) return;
  for (const Reading& r : bases) try_free_zeros(r);
}

Eigen::MatrixXd ConventionSearch::said_by(const Reading& r) {
  const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
  Eigen::MatrixXd out(T.rows(), n_);
  for (int j = 0; j < n_; ++j) out.col(r.order[j]) = r.torque_sign[j] / r.factor[j] * T.col(j);
  if (r.magnitude) out = out.cwiseAbs().eval();
  return out;
}

std::vector<bool> ConventionSearch::felt(const Reading& r) {
  const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
  std::vector<bool> out;
  for (int j = 0; j < n_; ++j) {
    double correlation = 0.0;
    full_.scale(r.order[j], j, T, correlation);
    out.push_back(correlation * correlation > options_.least_felt);
  }
  return out;
}

bool ConventionSearch::equivalent(const Reading& a, const Reading& b) {
  Eigen::MatrixXd apart = said_by(a) - said_by(b);
  for (int k = 0; k < n_; ++k) {
    full_.project(k, apart.col(k));
    if (apart.col(k).squaredNorm() > options_.model_error * full_.energy(k)) return false;
  }
  return true;
}

void ConventionSearch::sort() {
  std::stable_sort(found_.begin(), found_.end(),
                   [](const ReadingCandidate& a, const ReadingCandidate& b) { return a.score < b.score; });
}

Eigen::VectorXd ConventionSearch::rotor_bounds(const Robot& robot, const SpreadRows& rows) const {
  const int n = robot.size();
  const Model<> model(robot);
  Workspace<> ws(model);
  Eigen::MatrixXd M(n, n);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n), q(n);
  const Index count = std::min<Index>(8, rows.q.rows());
  for (Index i = 0; i < count; ++i) {
    q = rows.q.row(i).transpose();
    mass_matrix(model, ws, q, M);
    sum += M.diagonal().cwiseAbs();
  }
  return options_.most_rotor * sum / double(std::max<Index>(1, count));
}

Eigen::VectorXd ConventionSearch::measured(const Reading& r, int j, const Eigen::MatrixXd& T) const {
  Eigen::VectorXd tau = r.torque_sign[j] * r.factor[j] * full_.torque().col(r.order[j]);
  if (r.magnitude) {
    for (Index i = 0; i < tau.size(); ++i)
      if (T(i, j) < 0.0) tau[i] = -tau[i];
  }
  return tau;
}

double ConventionSearch::left_of(const Reading& r, int j, const Eigen::MatrixXd& T) const {
  if (r.magnitude) return left_of_magnitude(r, j, T);
  return full_.residual(r, j, T, r.torque_sign[j], r.factor[j]);
}

double ConventionSearch::left_of_magnitude(const Reading& r, int j, const Eigen::MatrixXd& T) const {
  const Eigen::ArrayXd tau = full_.torque().col(r.order[j]).array();
  Eigen::ArrayXd model = T.col(j).array();
  Eigen::VectorXd rest;
  double mean = 0.0;
  for (int pass = 0; pass < 3; ++pass) {
    rest = ((model >= 0.0).select(tau, -tau) - T.col(j).array()).matrix();
    const Eigen::VectorXd friction = full_.fitted(r, j, rest);
    mean = (rest - friction).mean();
    rest -= friction;
    model = T.col(j).array() + friction.array() + mean;
  }
  rest.array() -= mean;
  const double energy = full_.energy(r.order[j]);
  return energy > 0.0 ? rest.squaredNorm() / energy : 1.0;
}

Eigen::MatrixXd ConventionSearch::torque_of(const ConventionSample& sample, const Reading& r,
                                            const Eigen::Vector3d& g) {
  Eigen::MatrixXd out;
  kernel_->torque(sample, r, g, out);
  return out;
}

double ConventionSearch::evidence(const Eigen::VectorXd& left) const {
  double sum = 0.0;
  for (const double x : left)
    sum += std::log((std::min(x, options_.worst) + options_.model_error) / (1.0 + options_.model_error));
  return sum;
}

ReadingCandidate ConventionSearch::judged(const Reading& r, const Eigen::MatrixXd& T) const {
  ReadingCandidate c{r, Eigen::VectorXd(n_), 0.0};
  for (int j = 0; j < n_; ++j) c.left[j] = full_.residual(r, j, T, r.torque_sign[j], r.factor[j]);
  c.score = evidence(c.left) + r.complexity;
  return c;
}

bool ConventionSearch::needs_body(const ReadingCandidate& c) const {
  for (int j = 0; j < n_; ++j) {
    const double without = full_.bodyless(c.reading.order[j]);
    if (without > options_.model_error && c.left[j] < options_.least_part * without) return true;
  }
  // A body without gravity is a rotor by another name, but for its size: it has to be right on every joint,
  // nothing of it being fitted.
  if (!c.reading.without_gravity || !c.reading.factor.isOnes(0.0)) return false;
  Eigen::MatrixXd T;
  kernel_->torque(full_, c.reading, c.reading.gravity, T);
  for (int j = 0; j < n_; ++j)
    if (!(full_.bare_part(c.reading, j, T) < options_.most_bare)) return false;
  return true;
}

void ConventionSearch::keep(const ReadingCandidate& c) {
  if (c.score >= before_.score || !(needs_body(c) || lost_gravity(c.reading))) return;
  found_.push_back(c);
  if (found_.size() > 400) {
    sort();
    found_.resize(100);
  }
}

bool ConventionSearch::settled() {
  sort();
  return !found_.empty() && found_.front().left.maxCoeff() < options_.settled;
}

void ConventionSearch::add_signs(const Reading& r, const Eigen::MatrixXd& T, bool some_joints) {
  Eigen::VectorXd up(n_), down(n_), best(n_);
  for (int j = 0; j < n_; ++j) {
    up[j] = full_.residual(r, j, T, 1.0, r.factor[j]);
    down[j] = full_.residual(r, j, T, -1.0, r.factor[j]);
  }
  const auto add = [&](const Eigen::VectorXd& left, const Eigen::VectorXd& sign, double cost) {
    ReadingCandidate c{r, left, 0.0};
    c.reading.torque_sign = sign;
    c.reading.complexity += cost;
    c.score = evidence(left) + c.reading.complexity;
    keep(c);
  };
  add(up, Eigen::VectorXd::Ones(n_), 0.0);
  add(down, -Eigen::VectorXd::Ones(n_), 0.4);
  if (!some_joints) return;
  Eigen::VectorXd sign(n_);
  double cost = 0.4;
  for (int j = 0; j < n_; ++j) {
    sign[j] = down[j] < 0.5 * up[j] ? -1.0 : 1.0;
    best[j] = std::min(up[j], down[j]);
    if (sign[j] < 0.0) cost += 0.3;
    if (sign[j] > 0.0) best[j] = up[j];
  }
  if (sign.minCoeff() < 0.0 && sign.maxCoeff() > 0.0) add(best, sign, cost);
}

void ConventionSearch::add_factors(const Reading& r, const Eigen::MatrixXd& T) {
  for (const TorqueUnit& unit : torque_units) {
    Reading scaled = r;
    scaled.factor.setConstant(unit.factor);
    scaled.unit_of_torque = true;
    scaled.complexity += 0.4;
    add_signs(scaled, T, false);
  }
  Eigen::VectorXd factor(n_), weight(n_), sign(n_);
  std::vector<double> known;
  for (int j = 0; j < n_; ++j) {
    const double a = full_.scale(r.order[j], j, T, weight[j]);
    sign[j] = a < 0.0 ? -1.0 : 1.0;
    factor[j] = 1.0 / std::max(std::abs(a), 1e-12);
    if (weight[j] * weight[j] > options_.least_felt) known.push_back(factor[j]);
  }
  if (known.empty()) return;
  std::sort(known.begin(), known.end());
  const double median = known[known.size() / 2];
  if (median < options_.least_factor) return;
  for (int j = 0; j < n_; ++j) {
    if (weight[j] * weight[j] > options_.least_felt) continue;
    factor[j] = median;
    sign[j] = 1.0;
  }
  Reading scaled = r;
  scaled.factor = factor;
  scaled.complexity += 0.4 + 0.1 * n_;
  add_signs(scaled, T, true);
  // One ratio for all, where that does as well.
  scaled.factor.setConstant(median);
  scaled.complexity = r.complexity + 0.6;
  add_signs(scaled, T, false);
}

bool ConventionSearch::turned_gravity(const Reading& r, const Eigen::MatrixXd& without,
                                      const std::array<Eigen::MatrixXd, 3>& by, Eigen::Vector3d& g) {
  const double size = robot_.gravity.norm() > 0.0 ? robot_.gravity.norm() : 9.81;
  Eigen::VectorXd left = Eigen::VectorXd::Ones(n_);
  g = robot_.gravity;
  for (int pass = 0; pass < 4; ++pass) {
    Eigen::Matrix3d H = 1e-12 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (int j = 0; j < n_; ++j) {
      const int k = r.order[j];
      if (!(full_.energy(k) > 0.0)) continue;
      Eigen::MatrixXd X(full_.rows(), 3), y = full_.torque().col(k) - without.col(j);
      X << by[0].col(j), by[1].col(j), by[2].col(j);
      full_.project(k, X);
      full_.project(k, y);
      const double w = 1.0 / (full_.energy(k) * (std::min(left[j], 1.0) + options_.model_error));
      H += w * X.transpose() * X;
      b += w * X.transpose() * y;
      left[j] = (y - X * g).squaredNorm() / full_.energy(k);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(H);
    const double largest = axes.eigenvalues()[2];
    if (!(largest > 1e-9)) return false;
    // Along a direction that no joint feels, gravity is what its size leaves, on the model's side.
    Eigen::Vector3d solution = Eigen::Vector3d::Zero(), unseen = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d axis = axes.eigenvectors().col(i);
      if (axes.eigenvalues()[i] > 1e-4 * largest)
        solution += axis * (axis.dot(b) / axes.eigenvalues()[i]);
      else
        unseen += axis * axis.dot(robot_.gravity);
    }
    const double rest = size * size - solution.squaredNorm();
    if (rest > 0.0 && unseen.norm() > 1e-3 * size) solution += std::sqrt(rest) * unseen.normalized();
    g = solution;
  }
  if (std::abs(g.norm() / size - 1.0) > options_.gravity_tolerance) return false;
  g *= size / g.norm();
  for (int i = 0; i < 3; ++i)
    if (std::abs(g[i]) > size * std::cos(options_.snap_gravity)) {
      const double s = g[i] > 0.0 ? 1.0 : -1.0;
      g.setZero();
      g[i] = s * size;
    }
  const double cosine = g.dot(robot_.gravity) / (size * std::max(robot_.gravity.norm(), 1e-12));
  return cosine < std::cos(options_.least_mounting);
}

void ConventionSearch::add_all(const Reading& r) {
  const Eigen::MatrixXd T = torque_of(full_, r, r.gravity), without = torque_of(full_, r, {0, 0, 0});
  std::array<Eigen::MatrixXd, 3> by;
  for (int i = 0; i < 3; ++i) by[i] = torque_of(full_, r, Eigen::Vector3d::Unit(i)) - without;
  add_signs(r, T, true);
  add_factors(r, T);
  add_magnitude(r, T);
  Reading no_gravity = r;
  no_gravity.gravity.setZero();
  no_gravity.without_gravity = true;
  no_gravity.complexity += 0.5;
  add_signs(no_gravity, without, true);
  add_factors(no_gravity, without);
  if (n_ == 1) return;  // one joint cannot tell a mounting from its zero
  const auto mounted = [&](const Eigen::Vector3d& g, double cost) {
    Reading turned = r;
    turned.gravity = g;
    turned.turned_gravity = true;
    turned.complexity += cost;
    add_signs(turned, without + g[0] * by[0] + g[1] * by[1] + g[2] * by[2], false);
  };
  Eigen::Vector3d fitted = Eigen::Vector3d::Zero();
  const bool any = turned_gravity(r, without, by, fitted);
  const bool square = fitted.cwiseAbs().maxCoeff() > 0.999 * fitted.norm();
  if (any && !square) mounted(fitted, 0.9);
  // Square mountings whatever the fit says: a payload may draw it away.
  const double size = robot_.gravity.norm() > 0.0 ? robot_.gravity.norm() : 9.81;
  for (int axis = 0; axis < 3; ++axis)
    for (const double way : {1.0, -1.0}) {
      const Eigen::Vector3d g = way * size * Eigen::Vector3d::Unit(axis);
      if (g.dot(robot_.gravity) < size * size * std::cos(options_.least_mounting)) mounted(g, 0.4);
    }
}

void ConventionSearch::add_magnitude(const Reading& r, const Eigen::MatrixXd& T) {
  // Smoothed, a magnitude dips below zero where it turns.
  const double most = full_.torque().maxCoeff();
  if (!(most > 0.0) || full_.torque().minCoeff() < -options_.dip * most) return;
  if (T.minCoeff() >= 0.0) return;
  ReadingCandidate c{r, Eigen::VectorXd(n_), 0.0};
  c.reading.magnitude = true;
  c.reading.complexity += 0.5;
  for (int j = 0; j < n_; ++j) c.left[j] = left_of(c.reading, j, T);
  c.score = evidence(c.left) + c.reading.complexity;
  keep(c);
}

}  // namespace dynid::detail
