// SPDX-License-Identifier: Apache-2.0
// A rigid body at the flange: ten columns of the last link. Its com and inertia are in the last link's frame.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

#include "dynid/base/error.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double behind_the_flange = 0.03;  // [m]: a ring around it

/// The body nearest to `c` in the norm of `information`: Newton's method along the central path of
/// (x - c)^T I (x - c) - log det P(x) / t, P the pseudo-inertia.
StandardParameters nearest_body(const StandardParameters& c, const Eigen::MatrixXd& information) {
  constexpr double gap = 1e-6;  // of the distance, relatively
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
    last = !(4.0 / t >= gap * distance(x));
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
        for (int j = 0; j < 10; ++j) curvature(i, j) += (a * moved[static_cast<std::size_t>(j)]).trace();
      }
      const Vector step = -curvature.ldlt().solve(slope);
      const double decrement = -slope.dot(step);
      if (!(decrement > 1e-6)) break;
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

class Payload : public Hypothesis {
 public:
  std::string name() const override { return "payload"; }
  Scope scope() const override { return Scope::arm; }
  ColumnBlock columns(const GapMotion& motion, int, const Eigen::VectorXd&) const override {
    ColumnBlock block;
    for (int j = 0; j < motion.joints(); ++j) {
      block.channels.push_back(j);
      block.values.push_back(motion.link_columns(motion.joints() - 1, j));
    }
    return block;
  }
  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    const LinkInertia body = from_standard(StandardParameters(c));
    Eigen::VectorXd inertia(6);
    inertia << body.inertia(0, 0), body.inertia(0, 1), body.inertia(0, 2), body.inertia(1, 1),
        body.inertia(1, 2), body.inertia(2, 2);
    return {{"mass", "kg", Eigen::VectorXd::Constant(1, body.mass), false},
            {"com", "m", body.com, false},
            {"inertia", "kg m^2", inertia, false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = to_standard(body(effect));
    shape.resize(0);
  }
  bool plausible(const Robot& robot, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    if (!(c[0] > 0.0) || (c.segment<3>(1) / c[0]).norm() > 1.0) return false;
    // Where the model says where the flange is, what it carries is in front of it.
    if (robot.tip.translation().norm() < 0.01) return true;
    const Eigen::Vector3d com = robot.tip.inverse() * Eigen::Vector3d(c.segment<3>(1) / c[0]);
    return com.z() > -behind_the_flange;
  }
  bool possible(const Eigen::VectorXd& c) const override {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> moments(pseudo_inertia(StandardParameters(c)));
    return moments.eigenvalues()[0] >= 0.0;
  }
  Eigen::VectorXd nearest_possible(const Eigen::VectorXd& c,
                                   const Eigen::MatrixXd& information) const override {
    return nearest_body(c, information);
  }

 private:
  static LinkInertia body(const Effect& effect) {
    LinkInertia b;
    b.mass = arm_value(effect, "mass", 1)[0];
    b.com = arm_value(effect, "com", 3);
    const Eigen::VectorXd i = arm_value(effect, "inertia", 6);
    b.inertia << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
    return b;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_payload() { return std::make_unique<Payload>(); }

}  // namespace dynid::detail
