// SPDX-License-Identifier: Apache-2.0
#include "prepared.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dynid {

Eigen::VectorXd stack(const std::vector<LinkInertia>& links) {
  Eigen::VectorXd p(10 * static_cast<Eigen::Index>(links.size()));
  for (std::size_t i = 0; i < links.size(); ++i) {
    StandardParameters entries;
    entries[0] = links[i].mass;
    entries.segment<3>(1) = links[i].com;
    set_inertia_tensor(entries, links[i].inertia);
    p.segment<10>(10 * static_cast<Eigen::Index>(i)) = entries;
  }
  return p;
}

std::vector<LinkInertia> unstack(const Eigen::VectorXd& p) {
  std::vector<LinkInertia> links(static_cast<std::size_t>(p.size() / 10));
  for (std::size_t i = 0; i < links.size(); ++i) {
    const StandardParameters entries = p.segment<10>(10 * static_cast<Eigen::Index>(i));
    links[i] = {entries[0], entries.segment<3>(1), inertia_tensor(entries)};
  }
  return links;
}

Eigen::VectorXd standard_parameters(const Eigen::VectorXd& p) {
  Eigen::VectorXd pi(p.size());
  for (Eigen::Index i = 0; i < p.size(); i += 10) {
    const StandardParameters entries = p.segment<10>(i);
    pi.segment<10>(i) = to_standard({entries[0], entries.segment<3>(1), inertia_tensor(entries)});
  }
  return pi;
}

namespace detail {

namespace {

// A value that is not finite is as bad as this, so that a penalised objective stays finite.
constexpr double worst_penalty = 1e6;

double exterior(double margin) { return std::min(worst_penalty, std::max(0.0, -margin)); }

}  // namespace

double triangle_margin(const Eigen::VectorXd& p, int i) {
  const StandardParameters entries = p.segment<10>(10 * i);
  return consistency_margins(LinkInertia{entries[0], entries.segment<3>(1), inertia_tensor(entries)})
      .triangle;
}

Prepared::Prepared(const RetrievalProblem& problem) : problem_(problem) {
  auto& constraints = problem_.bounds.constraints;
  constraints.erase(std::remove_if(constraints.begin(), constraints.end(),
                                   [](const Constraint& constraint) { return !constraint.enforced; }),
                    constraints.end());
  const Bounds& bounds = problem_.bounds;
  const int n = links();
  units_.resize(static_cast<std::size_t>(n));
  p_scale_.resize(size());
  p_offset_ = Eigen::VectorXd::Zero(size());
  Eigen::MatrixXd to_origin = Eigen::MatrixXd::Zero(size(), size());
  for (int i = 0; i < n; ++i) {
    const StandardParameters low = bounds.lower.segment<10>(10 * i), high = bounds.upper.segment<10>(10 * i);
    Units& units = units_[static_cast<std::size_t>(i)];
    units.origin = 0.5 * (low.segment<3>(1) + high.segment<3>(1));
    units.mass = std::max(high[0], 1e-3);
    units.length = std::max(0.5 * (high - low).segment<3>(1).norm(), 1e-3);
    StandardParameters scale;
    scale << units.mass, Eigen::Vector3d::Constant(units.length),
        Eigen::Matrix<double, 6, 1>::Constant(units.mass * units.length * units.length);
    p_scale_.segment<10>(10 * i) = scale;
    p_offset_.segment<3>(10 * i + 1) = units.origin;
    scale.segment<3>(1) *= units.mass;  // first moments
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = units.origin;
    to_origin.block<10, 10>(10 * i, 10 * i) = transform_matrix(pose) * scale.asDiagonal();
  }
  A_ = problem_.objective.weighted_matrix() * to_origin;
  b_ = problem_.objective.weighted_rhs();
  AtA_ = A_.transpose() * A_;
  find_interior();
  reference_ = problem_.prior ? *problem_.prior : uniform_solids();
}

Prior Prepared::uniform_solids() const {
  const Bounds& bounds = problem_.bounds;
  Prior prior;
  for (int i = 0; i < size(); i += 10) {
    LinkInertia link;
    link.mass = interior_ ? (*interior_)[i] : 0.5 * (bounds.lower[i] + bounds.upper[i]);
    link.com = 0.5 * (bounds.lower + bounds.upper).segment<3>(i + 1);
    const Eigen::Vector3d half = 0.5 * (bounds.upper - bounds.lower).segment<3>(i + 1);
    const Eigen::Vector3d second = link.mass / 3.0 * half.cwiseMax(1e-3).cwiseAbs2();
    link.inertia = (Eigen::Vector3d::Constant(second.sum()) - second).asDiagonal();
    prior.links.push_back(link);
  }
  return prior;
}

void Prepared::find_interior() {
  const Bounds& bounds = problem_.bounds;
  const int n = links();
  Eigen::VectorXd p = Eigen::VectorXd::Zero(size());
  double low_sum = 0.0, high_sum = 0.0;
  for (int i = 0; i < n; ++i) {
    low_sum += bounds.lower[10 * i];
    high_sum += bounds.upper[10 * i];
  }
  const double total =
      0.5 * (std::max(low_sum, bounds.total_mass_lower) + std::min(high_sum, bounds.total_mass_upper));
  const double part = high_sum > low_sum ? (total - low_sum) / (high_sum - low_sum) : 0.0;
  for (int i = 0; i < n; ++i) {
    const StandardParameters low = bounds.lower.segment<10>(10 * i), high = bounds.upper.segment<10>(10 * i);
    StandardParameters entries = low + 0.5 * (high - low);
    entries[0] = low[0] + part * (high[0] - low[0]);
    // Inertia: the products as small as they may be; the moments equal where they may be, first near what
    // such a mass would have in the box of its centre of mass, then large.
    const Units& units = units_[static_cast<std::size_t>(i)];
    const double natural = 0.1 * entries[0] * units.length * units.length;
    double best = -std::numeric_limits<double>::infinity();
    StandardParameters chosen = entries;
    for (const double moment : {natural, 10.0 * natural, 100.0 * natural, 1e300}) {
      for (const int k : {4, 6, 9})
        entries[k] = std::clamp(moment, low[k] + 1e-3 * (high[k] - low[k]), high[k]);
      for (const int k : {5, 7, 8}) {
        const double inside = 1e-3 * (high[k] - low[k]);
        entries[k] = std::clamp(0.0, low[k] + inside, high[k] - inside);
      }
      p.segment<10>(10 * i) = entries;
      const double margin = triangle_margin(p, i) / entries.segment<6>(4).maxCoeff();
      if (margin > best) {
        best = margin;
        chosen = entries;
      }
      if (best > 0.05) break;
    }
    if (!(best > 0.0)) return;
    p.segment<10>(10 * i) = chosen;
  }
  interior_ = p;
}

double Prepared::phi(const Eigen::VectorXd& p) const {
  return problem_.objective.weighted_value(standard_parameters(p));
}

double Prepared::gamma(const Eigen::VectorXd& p) const {
  double sum = 0.0, total = 0.0;
  for (int i = 0; i < links(); ++i) {
    sum += exterior(triangle_margin(p, i));
    total += p[10 * i];
  }
  sum += exterior(std::min(bounds().total_mass_upper - total, total - bounds().total_mass_lower));
  for (const Constraint& constraint : bounds().constraints) sum += exterior(constraint.margin(p));
  return sum;
}

double Prepared::smallest_margin(const Eigen::VectorXd& p) const {
  double least = std::min((p - bounds().lower).minCoeff(), (bounds().upper - p).minCoeff());
  double total = 0.0;
  for (int i = 0; i < links(); ++i) {
    // Eq. (11) is strict, and the mass bounds may start from zero.
    if (!(p[10 * i] > 0.0)) least = std::min(least, -1e-300);
    least = std::min(least, triangle_margin(p, i));
    total += p[10 * i];
  }
  least = std::min({least, bounds().total_mass_upper - total, total - bounds().total_mass_lower});
  for (const Constraint& constraint : bounds().constraints) {
    if (least < 0.0) return least;
    least = std::min(least, constraint.margin(p));
  }
  return std::isnan(least) ? -worst_penalty : least;
}

std::vector<int> Prepared::alternatives(const Eigen::VectorXd& p) const {
  std::vector<int> chosen;
  for (const Constraint& constraint : bounds().constraints) {
    int best = 0;
    double best_guard = -std::numeric_limits<double>::infinity(), best_margin = best_guard;
    for (std::size_t k = 0; constraint.alternatives.size() > 1 && k < constraint.alternatives.size(); ++k) {
      const Alternative& alternative = constraint.alternatives[k];
      double guard = 0.0,
             margin = std::numeric_limits<double>::infinity();  // guard: by how much it does not apply
      for (const Inequality& h : alternative.guards) guard = std::min(guard, h.value(p));
      for (const Inequality& h : alternative.required) margin = std::min(margin, h.value(p));
      if (guard > best_guard || (guard == best_guard && margin > best_margin)) {
        best = static_cast<int>(k);
        best_guard = guard;
        best_margin = margin;
      }
    }
    chosen.push_back(best);
  }
  return chosen;
}

Eigen::VectorXd Prepared::to_x(const Eigen::VectorXd& p) const {
  return standard_parameters(((p - p_offset_).array() / p_scale_.array()).matrix());
}

Eigen::VectorXd Prepared::to_p(const Eigen::VectorXd& x) const {
  Eigen::VectorXd p(x.size());
  for (Eigen::Index i = 0; i < x.size(); i += 10) {
    const LinkInertia link = from_standard(StandardParameters(x.segment<10>(i)));
    p.segment<10>(i) = stack({link});
  }
  return (p.array() * p_scale_.array()).matrix() + p_offset_;
}

}  // namespace detail

}  // namespace dynid
