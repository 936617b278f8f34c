// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/retrieval/retrieval.hpp"

namespace dynid::testing {

using Generator = std::mt19937_64;

inline double uniform(Generator& g, double low, double high) {
  return low + (high - low) * static_cast<double>(g() >> 11) * 0x1p-53;
}

inline double normal(Generator& g) {  // Box-Muller: the same on every machine
  return std::sqrt(-2.0 * std::log(uniform(g, 1e-300, 1.0))) *
         std::cos(6.283185307179586 * uniform(g, 0.0, 1.0));
}

/// A six-joint arm of the usual kind, with random lengths.
inline Robot random_arm(Generator& g) {
  constexpr double right = 1.5707963267948966;
  const double alphas[6] = {0.0, right, 0.0, 0.0, right, -right};
  Robot robot;
  for (int j = 0; j < 6; ++j) {
    const ModifiedDh dh{j == 2 || j == 3 ? uniform(g, 0.2, 0.6) : 0.0, alphas[j], uniform(g, 0.0, 0.2), 0.0};
    robot.joints.push_back(make_joint("joint" + std::to_string(j + 1), JointType::revolute, dh));
  }
  return robot;
}

/// A body whose centre of mass lies in [low, high].
inline LinkInertia random_body(Generator& g, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  LinkInertia link;
  link.mass = uniform(g, 0.5, 4.0);
  Eigen::Matrix3d A;
  for (int k = 0; k < 3; ++k) link.com[k] = uniform(g, low[k], high[k]);
  for (int k = 0; k < 9; ++k) A(k / 3, k % 3) = 0.05 * normal(g);
  const Eigen::Matrix3d second = link.mass * A * A.transpose();
  link.inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
  return link;
}

/// Boxes of random sizes around the frames' origins.
inline Bounds random_bounds(Generator& g, int n) {
  Bounds bounds;
  bounds.lower.resize(10 * n);
  bounds.upper.resize(10 * n);
  for (int i = 0; i < n; ++i) {
    Eigen::Vector3d low, high;
    for (int k = 0; k < 3; ++k) {
      low[k] = -uniform(g, 0.02, 0.2);
      high[k] = uniform(g, 0.02, 0.2);
    }
    bounds.lower.segment<10>(10 * i) << 0.0, low, 0.0, -1.0, 0.0, -1.0, -1.0, 0.0;
    bounds.upper.segment<10>(10 * i) << 10.0, high, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0;
  }
  return bounds;
}

/// A lower bound of phi over the feasible set of masses, centres of mass, eqs. (11), (16) and (30),
/// independent of any solver: phi is convex, so phi(y) >= phi(x) + grad phi(x) . (y - x), and the least of
/// the right side over the convex set is found link by link. Tight where x is optimal.
inline double lower_bound(const RetrievalProblem& problem, const Eigen::VectorXd& p) {
  const Bounds& bounds = problem.bounds;
  const Eigen::VectorXd pi = standard_parameters(p);
  const Eigen::VectorXd g = problem.objective.weighted_gradient(pi);
  std::vector<std::array<double, 3>> masses;  // price of a kilogram, its bounds
  double least = problem.objective.weighted_value(pi) - g.dot(pi);
  for (int i = 0; i < bounds.links(); ++i) {
    const int at = 10 * i;
    // g . pi = <G, Sigma> + 2 g_h . h + g_m m, over Sigma = Sigma_c + m c c^T.
    Eigen::Matrix3d J = inertia_tensor(g.segment<10>(at));
    J = (0.5 * (J + Eigen::Matrix3d(J.diagonal().asDiagonal())))
            .eval();  // products count twice in the tensor
    const Eigen::Matrix3d G = J.trace() * Eigen::Matrix3d::Identity() - J;
    const Eigen::Vector3d g_h = 0.5 * g.segment<3>(at + 1);
    const double lowest = std::min(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(G).eigenvalues()[0]);
    // tr Sigma_c = tr(I)/2, and the moments are bounded.
    least += lowest * 0.5 * (bounds.upper[at + 4] + bounds.upper[at + 6] + bounds.upper[at + 9]);
    const Eigen::Matrix3d convex = G - lowest * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d low = bounds.lower.segment<3>(at + 1), high = bounds.upper.segment<3>(at + 1);
    // Least of c^T convex c + 2 g_h . c over the box: on one of its 27 faces, edges, corners or inside.
    double box = 1e300;
    for (int face = 0; face < 27; ++face) {
      const int side[3] = {face % 3, face / 3 % 3, face / 9};
      Eigen::Vector3d c = Eigen::Vector3d::Zero();
      std::vector<int> free;
      for (int k = 0; k < 3; ++k) {
        if (side[k] == 2)
          free.push_back(k);
        else
          c[k] = side[k] == 0 ? low[k] : high[k];
      }
      if (!free.empty()) {
        const auto count = static_cast<Eigen::Index>(free.size());
        Eigen::MatrixXd A(count, count);
        Eigen::VectorXd b(count);
        for (Eigen::Index r = 0; r < count; ++r) {
          b[r] =
              -g_h[free[static_cast<std::size_t>(r)]] - convex.row(free[static_cast<std::size_t>(r)]).dot(c);
          for (Eigen::Index s = 0; s < count; ++s)
            A(r, s) = convex(free[static_cast<std::size_t>(r)], free[static_cast<std::size_t>(s)]);
        }
        const Eigen::VectorXd inside = A.completeOrthogonalDecomposition().solve(b);
        for (Eigen::Index r = 0; r < count; ++r) {
          const int k = free[static_cast<std::size_t>(r)];
          c[k] = std::clamp(inside[r], low[k], high[k]);
        }
      }
      box = std::min(box, c.dot(convex * c) + 2.0 * g_h.dot(c));
    }
    const double far = low.cwiseAbs().cwiseMax(high.cwiseAbs()).squaredNorm();
    masses.push_back({g[at] + box + lowest * far, bounds.lower[at], bounds.upper[at]});
  }
  // The cheapest masses with the sum in range: the smallest first, then the cheap ones while they pay or must
  // be.
  std::sort(masses.begin(), masses.end());
  double sum = 0.0;
  for (const auto& [price, low, high] : masses) {
    least += price * low;
    sum += low;
  }
  for (const auto& [price, low, high] : masses) {
    const double room = (price < 0.0 ? bounds.total_mass_upper : bounds.total_mass_lower) - sum;
    const double more = std::clamp(room, 0.0, high - low);
    least += price * more;
    sum += more;
  }
  return least;
}

inline double smallest_margin(const std::vector<ConstraintMargin>& constraints) {
  double least = 1e300;
  for (const ConstraintMargin& constraint : constraints) least = std::min(least, constraint.margin);
  return least;
}

/// The two-link arm of the supplementary material, Section V, on standard Denavit-Hartenberg frames: a map of
/// its own, since those frames do not turn about their origin. Coefficients by hand from its kinetic and
/// potential energy.
inline Eigen::MatrixXd two_link_coefficients() {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(8, 20);
  // Joint 2's axis is z of frame 1; link 2's frame sits a = 0.8 along its x axis beyond that axis.
  const double a = 0.8;
  Eigen::Isometry3d tip = Eigen::Isometry3d::Identity();
  tip.translation().x() = a;
  const Eigen::Matrix<double, 10, 10> T = transform_matrix(tip);
  // In the frame at the joint (standard parameters q = T pi_2): yy1 + yy2', mx2', my2', xx2' - yy2', xy2',
  // xz2', yz2', zz2' enter the dynamics, and nothing else.
  K(0, 6) = 1.0;
  K.row(0).tail<10>() = T.row(6);
  K.row(1).tail<10>() = T.row(1);
  K.row(2).tail<10>() = T.row(2);
  K.row(3).tail<10>() = T.row(4) - T.row(6);
  K.row(4).tail<10>() = T.row(5);
  K.row(5).tail<10>() = T.row(7);
  K.row(6).tail<10>() = T.row(8);
  K.row(7).tail<10>() = T.row(9);
  return K;
}

inline std::vector<LinkInertia> two_link_truth() {
  std::vector<LinkInertia> links(2);
  links[0].mass = 8.0;
  links[0].com = {0.01, -0.75, -0.02};
  links[0].inertia = Eigen::Vector3d(0.03, 0.03, 0.01).asDiagonal();
  links[1].mass = 3.0;
  links[1].com = {-0.1, 0.0, 0.0};
  links[1].inertia = Eigen::Vector3d(0.01, 0.04, 0.04).asDiagonal();
  return links;
}

/// Pose of the standard DH frame of link i (0 or 1) in a frame with its origin on the joint's axis, which is
/// its z: standard DH turns first, T_i = Rz(q) C_i.
inline Eigen::Isometry3d two_link_frame(int i) {
  Eigen::Isometry3d C = Eigen::Isometry3d::Identity();
  if (i == 0) {
    C.translation().z() = 1.5;
    C.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // Rx(90 deg)
  } else {
    C.translation().x() = 0.8;
  }
  return C;
}

/// The same arm for the kernels, its bodies given in the standard DH frames.
inline Robot two_link_robot(const std::vector<LinkInertia>& links) {
  Robot robot;
  robot.name = "two_link";
  robot.tip = two_link_frame(1);
  for (int i = 0; i < 2; ++i) {
    Joint joint;
    joint.name = "joint" + std::to_string(i + 1);
    joint.link_name = "link" + std::to_string(i + 1);
    if (i == 1) joint.origin = two_link_frame(0);
    joint.parameters = transformed(to_standard(links[static_cast<std::size_t>(i)]), two_link_frame(i));
    robot.joints.push_back(joint);
  }
  return robot;
}

inline Bounds two_link_bounds() {
  Bounds bounds;
  bounds.lower.resize(20);
  bounds.upper.resize(20);
  bounds.lower << 0, -0.15, -1.42, -0.15, 0, -1, 0, -1, -1, 0, 0, -0.8, -0.08, -0.08, 0, -1, 0, -1, -1, 0;
  bounds.upper << 10, 0.15, 0.08, 0.15, 1, 1, 1, 1, 1, 1, 5, 0, 0.08, 0.08, 1, 1, 1, 1, 1, 1;
  bounds.total_mass_lower = 1.0;
  bounds.total_mass_upper = 15.0;
  return bounds;
}

}  // namespace dynid::testing
