// SPDX-License-Identifier: Apache-2.0
#include "local_problem.hpp"

#include <algorithm>
#include <cmath>

#include "differences.hpp"
#include "link_derivatives.hpp"

namespace dynid::detail {
namespace {

bool all_finite(const double* first, const double* last) {
  return std::all_of(first, last, [](double v) { return std::isfinite(v); });
}

}  // namespace

bool LocalProblem::objective(const double* x, double& f) {
  point_.move_to(x);
  f = task_.scale * (point_.residual().squaredNorm() + layout_.slack_cost().dot(point_.columns()));
  if (task_.prior_weight > 0.0) {
    if (!std::isfinite(point_.prior())) return false;
    f += task_.scale * task_.prior_weight * point_.prior();
  }
  if (task_.pull > 0.0) f += task_.scale * task_.pull * (point_.unknowns() - task_.towards).squaredNorm();
  return std::isfinite(f);
}

bool LocalProblem::gradient(const double* x, double* gradient) {
  point_.move_to(x);
  const int n = layout_.unknowns();
  Eigen::Map<Eigen::VectorXd> g(gradient, layout_.columns());
  g = layout_.slack_cost();
  g.head(n) += 2.0 * prepared_.A().transpose() * point_.residual();
  if (task_.prior_weight > 0.0) {
    const LocalPoint::PriorTerm& prior = point_.prior_derivatives();
    if (!std::isfinite(prior.distance)) return false;
    g.head(n) += task_.prior_weight * prior.gradient;
  }
  if (task_.pull > 0.0) g.head(n) += 2.0 * task_.pull * (point_.unknowns() - task_.towards);
  g *= task_.scale;
  return g.allFinite();
}

bool LocalProblem::constraints(const double* x, double* g) {
  point_.move_to(x);
  for (const LocalLayout::Linear& linear : layout_.linear()) {
    *g = 0.0;
    for (std::size_t k = 0; k < linear.columns.size(); ++k) *g += linear.values[k] * x[linear.columns[k]];
    ++g;
  }
  if (layout_.consistency()) {
    const std::vector<Pivots>* pivots = point_.pivots(false);
    if (pivots == nullptr) return false;
    for (const Pivots& link : *pivots) g = std::copy(link.value.begin(), link.value.end(), g);
  }
  if (!layout_.needs_bodies()) return true;
  const LocalPoint::Bodies* bodies = point_.bodies();
  if (bodies == nullptr) return false;
  for (const int index : layout_.inertia()) *g++ = bodies->scaled[index];
  for (std::size_t k = 0; k < layout_.inequalities().size(); ++k) {
    const LocalLayout::InequalityRow& row = layout_.inequalities()[k];
    const double value = point_.inequality_values()[k];
    if (!std::isfinite(value)) return false;
    *g++ = row.scale * (value + (row.slack < 0 ? 0.0 : x[row.slack]));
  }
  return true;
}

double* LocalProblem::pivot_jacobian(const std::vector<Pivots>& pivots, double* out) const {
  for (const Pivots& link : pivots)
    for (const auto& gradient : link.gradient)
      out = std::copy(gradient.data(), gradient.data() + (layout_.elastic() ? 11 : 10), out);
  return out;
}

double* LocalProblem::body_jacobian(double* out) {
  const std::vector<Matrix10>& jacobians = point_.body_jacobians();
  for (const int index : layout_.inertia()) {
    const Vector10 row = jacobians[static_cast<std::size_t>(index / 10)].row(index % 10).transpose();
    out = std::copy(row.data(), row.data() + 10, out);
  }
  for (std::size_t k = 0; k < layout_.inequalities().size(); ++k) {
    const LocalLayout::InequalityRow& inequality = layout_.inequalities()[k];
    const Eigen::VectorXd& full = point_.inequality_gradients()[k];
    for (const int i : inequality.links) {
      const Vector10 row =
          jacobians[static_cast<std::size_t>(i)].transpose() * full.segment<10>(10 * i) * inequality.scale;
      out = std::copy(row.data(), row.data() + 10, out);
    }
    if (inequality.slack >= 0) *out++ = inequality.scale;
  }
  return out;
}

bool LocalProblem::jacobian(const double* x, double* values) {
  point_.move_to(x);
  double* out = values;
  for (const LocalLayout::Linear& linear : layout_.linear())
    out = std::copy(linear.values.begin(), linear.values.end(), out);
  if (layout_.consistency()) {
    const std::vector<Pivots>* pivots = point_.pivots(true);
    if (pivots == nullptr) return false;
    out = pivot_jacobian(*pivots, out);
  }
  if (layout_.needs_bodies()) {
    if (point_.bodies() == nullptr) return false;
    out = body_jacobian(out);
  }
  return all_finite(values, out);
}

int LocalProblem::hessian_size() const noexcept {
  const int n = layout_.unknowns();
  return n * (n + 1) / 2 + (layout_.elastic() ? 11 * prepared_.links() : 0);
}

void LocalProblem::hessian_pattern(int* rows, int* columns) const {
  for (int r = 0; r < layout_.unknowns(); ++r) {
    for (int c = 0; c <= r; ++c) {
      *rows++ = r;
      *columns++ = c;
    }
  }
  for (int i = 0; layout_.elastic() && i < prepared_.links(); ++i) {
    for (int k = 0; k < 11; ++k) {
      *rows++ = layout_.triangle_slack(i);
      *columns++ = k < 10 ? 10 * i + k : layout_.triangle_slack(i);
    }
  }
}

Eigen::MatrixXd LocalProblem::objective_hessian() {
  Eigen::MatrixXd H = 2.0 * prepared_.AtA();
  if (task_.prior_weight > 0.0) H += task_.prior_weight * point_.prior_derivatives().hessian;
  H.diagonal().array() += 2.0 * task_.pull;
  return H;
}

/// `multiplier`: of the inertia's rows, then of the user's inequalities.
void LocalProblem::add_body_hessian(const double* multiplier, Eigen::MatrixXd& H) {
  const int n = layout_.unknowns();
  const std::vector<Matrix10>& jacobians = point_.body_jacobians();
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(n);
  for (const int index : layout_.inertia()) weight[index] += *multiplier++;
  for (std::size_t k = 0; k < layout_.inequalities().size(); ++k) {
    const LocalLayout::InequalityRow& inequality = layout_.inequalities()[k];
    const double by = *multiplier++ * inequality.scale;
    if (by == 0.0) continue;
    weight += by * point_.inequality_gradients()[k];
    const Eigen::MatrixXd curvature = detail::hessian(*inequality.h, point_.bodies()->p);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(curvature.rows(), n);
    for (std::size_t l = 0; l < inequality.over.size(); ++l) {
      const int v = inequality.over[l], i = v / 10;
      J.block<1, 10>(static_cast<Eigen::Index>(l), 10 * i) =
          prepared_.p_scale()[v] * jacobians[static_cast<std::size_t>(i)].row(v % 10);
    }
    H += by * J.transpose() * curvature * J;
  }
  for (int i = 0; i < n; i += 10)
    H.block<10, 10>(i, i) += link_hessian(point_.unknowns().segment<10>(i), weight.segment<10>(i));
}

bool LocalProblem::hessian(const double* x, double factor, const double* lambda, double* values) {
  point_.move_to(x);
  const int n = layout_.unknowns();
  if (task_.prior_weight > 0.0 && !std::isfinite(point_.prior_derivatives().distance)) return false;
  Eigen::MatrixXd H = objective_hessian();
  H *= task_.scale * factor;
  double* slack_block = values + n * (n + 1) / 2;
  const double* multiplier = lambda + layout_.linear().size();
  if (layout_.consistency()) {
    const std::vector<Pivots>* pivots = point_.pivots(true);
    if (pivots == nullptr) return false;
    int at = 0;
    for (const Pivots& link : *pivots) {
      Eigen::Matrix<double, 11, 11> sum = Eigen::Matrix<double, 11, 11>::Zero();
      for (const auto& hessian : link.hessian) sum += *multiplier++ * hessian;
      H.block<10, 10>(at, at) += sum.topLeftCorner<10, 10>();
      if (layout_.elastic())
        slack_block = std::copy(sum.col(10).data(), sum.col(10).data() + 11, slack_block);
      at += 10;
    }
  }
  if (layout_.needs_bodies()) {
    if (point_.bodies() == nullptr) return false;
    add_body_hessian(multiplier, H);
  }
  double* out = values;
  for (int r = 0; r < n; ++r)
    for (int c = 0; c <= r; ++c) *out++ = H(r, c);
  return all_finite(values, values + hessian_size());
}

}  // namespace dynid::detail
