// SPDX-License-Identifier: Apache-2.0
// What a payload or a wrong link may explain beside a reading.
#include <Eigen/Dense>
#include <cmath>

#include "conventions_search.hpp"

namespace dynid::detail {

using Eigen::Index;

void ConventionSearch::add_free_factors() {
  const std::size_t known = std::min<std::size_t>(found_.size(), 2);
  for (std::size_t k = 0; k < known; ++k) {
    if (!found_[k].reading.unit_of_torque) continue;
    ReadingCandidate free = found_[k];
    free.reading.unit_of_torque = false;
    free.reading.complexity += 0.1 * n_;
    free.score += 0.1 * n_;
    found_.insert(found_.begin() + static_cast<std::ptrdiff_t>(known), free);
  }
}

ReadingCandidate ConventionSearch::with_payload(const ReadingCandidate& from) {
  return with_more(from, n_ - 1, StandardParameters::Zero());
}

ReadingCandidate ConventionSearch::with_wrong_body(const ReadingCandidate& from) {
  ReadingCandidate best = with_payload(from);
  if (n_ == 1) return best;  // an arm of one link that may be any body is any arm: no reading could be told
  for (int link = 0; link < n_; ++link) {
    ReadingCandidate other = with_more(from, link, robot_.joints[static_cast<std::size_t>(link)].parameters);
    if (other.score < best.score) best = std::move(other);
  }
  return best;
}

ReadingCandidate ConventionSearch::with_more(const ReadingCandidate& from, int link,
                                             const StandardParameters& known) {
  ReadingCandidate out = from;
  Reading& r = out.reading;
  std::vector<Eigen::MatrixXd> columns;
  // A controller that takes gravity off knows its arm, not what it carries.
  Reading heavy = r;
  if (r.without_gravity) heavy.gravity = robot_.gravity;
  kernel_->link(full_, heavy, link, columns);
  const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
  Eigen::MatrixXd loaded = T;
  double arm_mass = 0.0;
  for (const Joint& joint : robot_.joints) arm_mass += std::max(joint.parameters[0], 0.0);
  const bool factors = !r.unit_of_torque && !r.factor.isOnes(0.0);
  for (int pass = 0; pass < (factors ? 6 : 3); ++pass) {
    Eigen::Matrix<double, 10, 10> H = Eigen::Matrix<double, 10, 10>::Zero();
    Eigen::Matrix<double, 10, 1> g = Eigen::Matrix<double, 10, 1>::Zero();
    for (int j = 0; j < n_; ++j) {
      const int k = r.order[j];
      if (!(full_.energy(k) > 0.0)) continue;
      Eigen::MatrixXd X = columns[j], y = measured(r, j, loaded) - T.col(j);
      full_.project(k, X);
      full_.project(k, y);
      const double f = r.factor[j];
      const double w = 1.0 / (f * f * full_.energy(k) * (std::min(out.left[j], 1.0) + options_.model_error));
      H += w * X.transpose() * X;
      g += w * X.transpose() * y;
    }
    const StandardParameters more = physical_fit(H, g, arm_mass, known);
    for (int j = 0; j < n_; ++j) loaded.col(j) = T.col(j) + columns[j] * more;
    for (int j = 0; j < n_; ++j) {
      if (factors) {
        double correlation = 0.0;
        const double a = full_.scale(r.order[j], j, loaded, correlation);
        if (correlation * correlation > options_.least_felt && std::abs(a) > 0.0)
          r.factor[j] = 1.0 / std::abs(a);
      }
      out.left[j] = left_of(r, j, loaded);
    }
  }
  out.score = evidence(out.left) + r.complexity + options_.payload_cost;
  return out.score < from.score ? out : from;
}

ReadingCandidate ConventionSearch::judged_loaded(const Reading& reading) {
  const Eigen::MatrixXd T = torque_of(full_, reading, reading.gravity);
  ReadingCandidate c{reading, Eigen::VectorXd(n_), 0.0};
  for (int j = 0; j < n_; ++j) c.left[j] = left_of(reading, j, T);
  c.score = evidence(c.left) + reading.complexity;
  return with_payload(c);
}

StandardParameters ConventionSearch::physical_fit(Eigen::Matrix<double, 10, 10> H,
                                                  const StandardParameters& g, double arm_mass,
                                                  const StandardParameters& known) const {
  using Vector = StandardParameters;
  // A change as heavy as the arm costs as much as a twentieth of one joint's torque.
  H(0, 0) += 0.05 / (options_.model_error * std::max(arm_mass * arm_mass, 1e-12));
  // P = L L^T, L lower triangular, is any body that can exist; Levenberg's steps in its ten entries.
  const auto more = [&](const Vector& l) {
    Eigen::Matrix4d L = Eigen::Matrix4d::Zero();
    for (int i = 0, k = 0; i < 4; ++i)
      for (int j = 0; j <= i; ++j) L(i, j) = l[k++];
    return Vector(from_pseudo_inertia(L * L.transpose()) - known);
  };
  const auto cost = [&](const Vector& x) { return x.dot(H * x) - 2.0 * g.dot(x); };
  std::vector<Vector> starts;
  const Eigen::LLT<Eigen::Matrix4d> factor(pseudo_inertia(known));
  if (factor.info() == Eigen::Success) {
    const Eigen::Matrix4d L = factor.matrixL();
    starts.emplace_back();
    for (int i = 0, k = 0; i < 4; ++i)
      for (int j = 0; j <= i; ++j) starts.back()[k++] = L(i, j);
  } else {
    for (const double part : {0.3, 0.05}) {
      const double m = std::sqrt(part * std::max(arm_mass, 1e-3)), a = 0.1 * m;
      starts.emplace_back();
      starts.back() << a, 0.01 * a, a, 0.01 * a, 0.01 * a, a, 0.01 * a, 0.01 * a, 0.01 * a, m;
    }
  }
  Vector best = Vector::Zero();
  double lowest = 0.0;
  for (Vector l : starts) {
    const double m = std::max(std::abs(l[9]), 1e-3);
    double now = cost(more(l)), damping = 1e-3;
    for (int step = 0; step < 60; ++step) {
      Eigen::Matrix<double, 10, 10> J;
      const Vector x = more(l);
      for (int k = 0; k < 10; ++k) {
        Vector moved = l;
        const double h = 1e-6 * (std::abs(l[k]) + 1e-3 * m);
        moved[k] += h;
        J.col(k) = (more(moved) - x) / h;
      }
      Eigen::Matrix<double, 10, 10> A = J.transpose() * H * J;
      const Vector b = J.transpose() * (g - H * x);
      A.diagonal() += damping * A.diagonal() + Vector::Constant(1e-12 * A.trace());
      const Vector tried = l + A.ldlt().solve(b);
      const double there = tried.allFinite() ? cost(more(tried)) : now + 1.0;
      if (there < now) {
        const double gain = now - there;
        l = tried, now = there, damping = std::max(1e-9, 0.3 * damping);
        if (gain < 1e-9 * std::abs(now)) break;
      } else {
        damping *= 10.0;
        if (damping > 1e8) break;
      }
    }
    if (now < lowest) lowest = now, best = more(l);
  }
  return best;
}

}  // namespace dynid::detail
