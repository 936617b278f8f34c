// SPDX-License-Identifier: Apache-2.0
// A rigid body at the flange: ten columns of the last link. Its com and inertia are in the last link's frame.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "dynid/error.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double behind_the_flange = 0.03;  // [m]: a ring around it

using Lower = Eigen::Matrix<double, 10, 1>;  // of a 4 x 4 matrix, column by column

Eigen::Matrix4d lower(const Lower& x) {
  Eigen::Matrix4d L = Eigen::Matrix4d::Zero();
  for (int k = 0, c = 0; c < 4; ++c)
    for (int r = c; r < 4; ++r) L(r, c) = x[k++];
  return L;
}

/// The body nearest to `c` in the norm of `information`: its pseudo-inertia is L L^T, which every L makes a
/// body; Levenberg-Marquardt over L.
StandardParameters nearest_body(const StandardParameters& c, const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> metric(information);
  const Eigen::MatrixXd root =
      metric.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * metric.eigenvectors().transpose();
  // Starts from the body of no negative moments.
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> moments(pseudo_inertia(c));
  const double least = 1e-3 * moments.eigenvalues().cwiseAbs().maxCoeff();
  const Eigen::Matrix4d start = moments.eigenvectors() * moments.eigenvalues().cwiseMax(least).asDiagonal() *
                                moments.eigenvectors().transpose();
  const Eigen::Matrix4d L = start.llt().matrixL();
  Lower x;
  for (int k = 0, col = 0; col < 4; ++col)
    for (int r = col; r < 4; ++r) x[k++] = L(r, col);
  const auto body = [](const Lower& at) { return from_pseudo_inertia(lower(at) * lower(at).transpose()); };
  StandardParameters best = body(x);
  double distance = (root * (best - c)).squaredNorm(), damping = 1e-3;
  for (int k = 0; k < 100 && damping < 1e12; ++k) {
    Eigen::Matrix<double, 10, 10> J;
    for (int i = 0; i < 10; ++i) {
      const Eigen::Matrix4d D = lower(Lower::Unit(i)), half = D * lower(x).transpose();
      J.col(i) = from_pseudo_inertia(half + half.transpose());
    }
    const Eigen::MatrixXd RJ = root * J;
    Eigen::MatrixXd H = RJ.transpose() * RJ;
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += 1e-15 * H.trace();
    const Lower step = H.ldlt().solve(RJ.transpose() * (root * (c - best)));
    const StandardParameters there = body(x + step);
    const double now = (root * (there - c)).squaredNorm();
    if (!(now < distance)) {
      damping *= 10.0;
      continue;
    }
    const bool done = now > distance * (1.0 - 1e-9);
    x += step, best = there, distance = now, damping = std::max(1e-9, 0.1 * damping);
    if (done) break;
  }
  return best;
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
  bool enter(Robot& robot, const Effect& effect) const override {
    robot.joints.back().parameters += to_standard(body(effect));
    return true;
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
