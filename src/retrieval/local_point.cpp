// SPDX-License-Identifier: Apache-2.0
#include "local_point.hpp"

#include <algorithm>
#include <utility>

#include "link_derivatives.hpp"
#include "prior_distance.hpp"

namespace dynid::detail {

void LocalPoint::move_to(const double* x) {
  if (columns_.size() == layout_.columns() && std::equal(x, x + layout_.columns(), columns_.data())) return;
  columns_ = Eigen::Map<const Eigen::VectorXd>(x, layout_.columns());
  unknowns_ = columns_.head(layout_.unknowns());
  residual_.reset();
  prior_.reset();
  prior_derivatives_.reset();
  pivots_known_ = Known::nothing;
  bodies_.reset();
  values_.reset();
  jacobians_.clear();
  gradients_.reset();
}

const Eigen::VectorXd& LocalPoint::residual() {
  if (!residual_) residual_ = prepared_.A() * unknowns_ - prepared_.b();
  return *residual_;
}

double LocalPoint::prior() {
  if (!prior_)
    prior_ = prior_derivatives_ ? prior_derivatives_->distance : prior_distance(prepared_, unknowns_);
  return *prior_;
}

const LocalPoint::PriorTerm& LocalPoint::prior_derivatives() {
  if (!prior_derivatives_) {
    PriorTerm term;
    term.distance = prior_distance(prepared_, unknowns_, &term.gradient, &term.hessian);
    prior_derivatives_ = std::move(term);
  }
  return *prior_derivatives_;
}

const std::vector<Pivots>* LocalPoint::pivots(bool derivatives) {
  if (pivots_known_ < (derivatives ? Known::derivatives : Known::values)) {
    pivots_.resize(static_cast<std::size_t>(prepared_.links()));
    pivots_known_ = derivatives ? Known::derivatives : Known::values;
    pivots_defined_ = true;
    for (int i = 0; i < prepared_.links() && pivots_defined_; ++i) {
      const double slack = layout_.elastic() ? columns_[layout_.triangle_slack(i)] : 0.0;
      const Eigen::Matrix4d P = shifted_pseudo_inertia(unknowns_.segment<10>(10 * i), slack - strict_margin);
      pivots_defined_ = pivots_[static_cast<std::size_t>(i)].evaluate(P, derivatives);
    }
  }
  return pivots_defined_ ? &pivots_ : nullptr;
}

const LocalPoint::Bodies* LocalPoint::bodies() {
  if (!bodies_) {
    Bodies bodies;
    bodies.scaled.resize(layout_.unknowns());
    for (int i = 0; i < layout_.unknowns(); i += 10) {
      if (!(unknowns_[i] > 0.0)) return nullptr;
      bodies.scaled.segment<10>(i) = stack({from_standard(StandardParameters(unknowns_.segment<10>(i)))});
    }
    bodies.p = bodies.scaled.cwiseProduct(prepared_.p_scale()) + prepared_.p_offset();
    bodies_ = std::move(bodies);
  }
  return &*bodies_;
}

const std::vector<double>& LocalPoint::inequality_values() {
  if (!values_) {
    std::vector<double> made;
    for (const LocalLayout::InequalityRow& row : layout_.inequalities())
      made.push_back(row.h->value(bodies()->p));
    values_ = std::move(made);
  }
  return *values_;
}

const std::vector<Matrix10>& LocalPoint::body_jacobians() {
  if (jacobians_.empty())
    for (int i = 0; i < layout_.unknowns(); i += 10)
      jacobians_.push_back(link_jacobian(unknowns_.segment<10>(i)));
  return jacobians_;
}

const std::vector<Eigen::VectorXd>& LocalPoint::inequality_gradients() {
  if (!gradients_) {
    std::vector<Eigen::VectorXd> made;
    for (const LocalLayout::InequalityRow& row : layout_.inequalities())
      made.push_back(scaled_gradient(prepared_, row, bodies()->p));
    gradients_ = std::move(made);
  }
  return *gradients_;
}

}  // namespace dynid::detail
