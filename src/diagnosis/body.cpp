// SPDX-License-Identifier: Apache-2.0
#include "body.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace dynid::detail {

bool is_body(const StandardParameters& p) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> moments(pseudo_inertia(p));
  return moments.eigenvalues()[0] >= 0.0;
}

StandardParameters nearest_body(const StandardParameters& c, const Eigen::MatrixXd& information) {
  // Of the distance, relatively; and, as that is in units of log evidence, what says nothing. Without it a c
  // at the very border takes as many steps as a double has powers of ten.
  constexpr double gap = 1e-6, nothing = 1e-4;
  constexpr double on_the_way = 0.1, at_the_end = 1e-6;  // decrements: on the way a centre need only be near
  using Vector = Eigen::Matrix<double, 10, 1>;
  using Matrix = Eigen::Matrix<double, 10, 10>;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> moments(pseudo_inertia(c));
  const double least = 1e-2 * moments.eigenvalues().cwiseAbs().maxCoeff();
  StandardParameters x =
      from_pseudo_inertia(moments.eigenvectors() * moments.eigenvalues().cwiseMax(least).asDiagonal() *
                          moments.eigenvectors().transpose());
  Matrix G = information;
  G.diagonal().array() += 1e-12 * G.trace();
  const auto distance = [&](const StandardParameters& at) { return (at - c).dot(G * (at - c)); };
  if (!(distance(x) > 0.0)) return x;  // nothing tells them apart
  double t = 4.0 / distance(x);
  for (bool last = false; !last; t *= 10.0) {
    last = !(4.0 / t >= std::max(nothing, gap * distance(x)));
    for (int k = 0; k < 50; ++k) {
      const Eigen::Matrix4d inverse = pseudo_inertia(x).inverse();
      Vector slope = 2.0 * t * (G * (x - c));
      Matrix curvature = 2.0 * t * G;
      std::array<Eigen::Matrix4d, 10> moved;
      for (int i = 0; i < 10; ++i)
        moved[static_cast<std::size_t>(i)] = inverse * pseudo_inertia(StandardParameters::Unit(i));
      for (int i = 0; i < 10; ++i) {
        const Eigen::Matrix4d& a = moved[static_cast<std::size_t>(i)];
        slope[i] -= a.trace();
        for (int j = 0; j <= i; ++j) {  // the trace of their product
          const double both = a.cwiseProduct(moved[static_cast<std::size_t>(j)].transpose()).sum();
          curvature(i, j) += both;
          if (j < i) curvature(j, i) += both;
        }
      }
      const Eigen::LLT<Matrix> factors(curvature);
      if (factors.info() != Eigen::Success) break;  // at the border, rounding has the last word
      const Vector step = -factors.solve(slope);
      const double decrement = -slope.dot(step);
      if (!(decrement > (last ? at_the_end : on_the_way))) break;
      // Damped as far as a self-concordant function asks for: but for rounding, the point stays inside.
      double part = 1.0 / (1.0 + std::sqrt(decrement));
      while (part > 1e-12 &&
             pseudo_inertia(StandardParameters(x + part * step)).llt().info() != Eigen::Success)
        part *= 0.5;
      x += part * step;
    }
  }
  return x;
}

}  // namespace dynid::detail
