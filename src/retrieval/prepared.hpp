// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dynid/retrieval/retrieval.hpp"

namespace dynid::detail {

/// The problem as the optimisers see it: what does not change over the runs, worked out once.
class Prepared {
 public:
  explicit Prepared(const RetrievalProblem& problem);

  const RetrievalProblem& problem() const noexcept { return problem_; }
  const Bounds& bounds() const noexcept { return problem_.bounds; }
  int links() const noexcept { return problem_.bounds.links(); }
  int size() const noexcept { return 10 * links(); }

  /// phi (weighted), gamma and f = phi + xi gamma of Algorithm 1.
  double phi(const Eigen::VectorXd& p) const;
  double gamma(const Eigen::VectorXd& p) const;
  double f(const Eigen::VectorXd& p, double xi) const { return phi(p) + (xi > 0.0 ? xi * gamma(p) : 0.0); }

  /// The smallest of all margins, each in its own unit: >= 0 exactly where `p` is feasible.
  double smallest_margin(const Eigen::VectorXd& p) const;

  /// Index of the alternative of each constraint that `p` satisfies best.
  std::vector<int> alternatives(const Eigen::VectorXd& p) const;

  /// A point strictly inside eqs. (11), (16), (30) and the bounds, where one is known.
  const std::optional<Eigen::VectorXd>& interior() const noexcept { return interior_; }

  /// What picks among equals: the prior given or, without one, a uniform solid that fills the box of each
  /// link's centre of mass.
  const Prior& reference() const noexcept { return reference_; }

  /// Units and origin in which link i's unknowns are of order one: its largest mass, the size and the centre
  /// of the box of its centre of mass.
  struct Units {
    double mass = 1.0;
    double length = 1.0;
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  };
  const std::vector<Units>& units() const noexcept { return units_; }

  /// x: standard parameters of every link about Units::origin, in its units. In x eqs. (11), (16), (30) and
  /// the bounds on masses and centres of mass are convex and phi is quadratic.
  Eigen::VectorXd to_x(const Eigen::VectorXd& p) const;
  Eigen::VectorXd to_p(const Eigen::VectorXd& x) const;
  /// p = offset + scale * (m, c, I of x), entry by entry.
  const Eigen::VectorXd& p_scale() const noexcept { return p_scale_; }
  const Eigen::VectorXd& p_offset() const noexcept { return p_offset_; }
  /// phi = |A x - b|^2 + constant.
  const Eigen::MatrixXd& A() const noexcept { return A_; }
  const Eigen::VectorXd& b() const noexcept { return b_; }
  const Eigen::MatrixXd& AtA() const noexcept { return AtA_; }

 private:
  void find_interior();
  Prior uniform_solids() const;

  RetrievalProblem problem_;
  std::vector<Units> units_;
  Eigen::VectorXd p_scale_, p_offset_;
  Eigen::MatrixXd A_, AtA_;
  Eigen::VectorXd b_;
  std::optional<Eigen::VectorXd> interior_;
  Prior reference_;
};

/// tr(I)/2 - lambda_max(I) of link i of p, eq. (16).
double triangle_margin(const Eigen::VectorXd& p, int i);

}  // namespace dynid::detail
