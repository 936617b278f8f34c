// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cstdio>
#include <string>

#include "chains.hpp"
#include "dual.hpp"
#include "dynid/dynamics/dynamics.hpp"

namespace dynid::test {
namespace {

/// The largest relative error seen of each law, and where.
struct Worst {
  double error = 0.0;
  std::string where;
  void see(double e, const std::string& at) {
    if (e > error || !(e == e)) error = e == e ? e : HUGE_VAL, where = at;
  }
};

struct Campaign {
  Worst regressor, sum, skew, forward, stack, symmetric, wrench, power, linear;
  int indefinite = 0;

  void check() const {
    const auto within = [](const Worst& worst, const char* law) {
      EXPECT_LE(worst.error, 1e-10) << law << " at " << worst.where;
      std::printf("  %-40s %.1e\n", law, worst.error);
    };
    within(regressor, "Y pi = inverse dynamics");
    within(sum, "M ddq + S dq + g = inverse dynamics");
    within(skew, "dM/dt - 2 S skew-symmetric");
    within(forward, "forward dynamics after inverse");
    within(stack, "eq. (17): inertia stack");
    within(symmetric, "M symmetric");
    within(wrench, "joint wrench along the axis");
    within(power, "power = rate of energy");
    within(linear, "inverse dynamics linear in pi");
    EXPECT_EQ(indefinite, 0) << "mass matrix not positive definite";
  }
};

template <int N>
void run(const Robot& robot, int count, Campaign& c) {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;
  const Model<N> model(robot);
  const int n = model.size();
  Workspace<N> ws(model);
  const Model<N> dual_model = model;
  Workspace<N, Dual> dual_ws(dual_model);
  Eigen::VectorXd pi(10 * n);
  for (int i = 0; i < n; ++i) pi.segment<10>(10 * i) = robot.joints[i].parameters;

  Vector tau(n), g(n), back(n);
  Square M(n, n), S(n, n), dM(n, n);
  Eigen::Matrix<double, N, N == Eigen::Dynamic ? N : 10 * N> Y(n, 10 * n);
  Eigen::MatrixXd Ys(n * (n + 1) / 2 + n, 10 * n);
  Eigen::Matrix<double, 6, N> W(6, n);
  Eigen::Matrix<Dual, N, 1> qd(n), dqd(n);
  Eigen::Matrix<Dual, N, N> Md(n, n);

  for (int k = 0; k < count; ++k) {
    const unsigned seed = static_cast<unsigned>(k);
    Generator generator(seed);
    const Vector q = random_state(generator, n, 3.0), dq = random_state(generator, n, 2.0);
    const Vector ddq = random_state(generator, n, 5.0);
    const std::string at = robot.name + ", seed " + std::to_string(seed);

    inverse_dynamics(model, ws, q, dq, ddq, tau);
    regressor(model, ws, q, dq, ddq, Y);
    mass_matrix(model, ws, q, M);
    coriolis_matrix(model, ws, q, dq, S);
    gravity(model, ws, q, g);
    const double size = (M * ddq).norm() + (S * dq).norm() + g.norm();
    c.regressor.see((Y * pi - tau).norm() / size, at);
    c.sum.see((M * ddq + S * dq + g - tau).norm() / size, at);
    c.symmetric.see((M - M.transpose()).norm() / M.norm(), at);
    if (Eigen::LLT<Square>(M).info() != Eigen::Success) ++c.indefinite;

    // dM/dt along dq, and the rate of the energy, both exactly.
    for (int i = 0; i < n; ++i) qd[i] = Dual(q[i], dq[i]), dqd[i] = Dual(dq[i], ddq[i]);
    mass_matrix(dual_model, dual_ws, qd, Md);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) dM(i, j) = Md(i, j).d;
    const Square D = dM - 2.0 * S;
    c.skew.see((D + D.transpose()).norm() / (M.norm() * dq.norm()), at);
    const Dual energy =
        kinetic_energy(dual_model, dual_ws, qd, dqd) + potential_energy(dual_model, dual_ws, qd);
    c.power.see(std::abs(energy.d - dq.dot(tau)) / (dq.norm() * size), at);

    forward_dynamics(model, ws, q, dq, tau, back);
    c.forward.see((back - ddq).norm() / ddq.norm(), at);

    inertia_stack_regressor(model, ws, q, Ys);
    const Eigen::VectorXd stack = Ys * pi;
    double error = 0.0;
    for (int i = 0, row = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) error = std::max(error, std::abs(stack[row++] - M(i, j)));
    c.stack.see(error / M.norm(), at);
    c.stack.see((stack.tail(n) - g).norm() / size, at);

    joint_wrenches(model, ws, q, dq, ddq, W);
    for (int i = 0; i < n; ++i) {
      const bool slides = robot.joints[i].type == JointType::prismatic;
      const double along =
          robot.joints[i].axis.dot(slides ? W.col(i).template head<3>() : W.col(i).template tail<3>());
      c.wrench.see(std::abs(along - tau[i]) / size, at);
    }

    if (k % 16 == 0) {  // another parameter vector, physical or not
      const Eigen::VectorXd other = random_state(generator, 10 * n, 1.0);
      Model<N> sum = model.with_parameters(pi + 2.0 * other), alone = model.with_parameters(other);
      Vector a(n), b(n);
      inverse_dynamics(sum, ws, q, dq, ddq, a);
      inverse_dynamics(alone, ws, q, dq, ddq, b);
      c.linear.see((a - tau - 2.0 * b).norm() / (size + b.norm()), at);
    }
  }
}

TEST(Laws, Panda) {
  Campaign campaign;
  run<7>(panda(), states(100000), campaign);
  campaign.check();
}

TEST(Laws, ChainWithYAxesAndTurnedOrigins) {
  Campaign campaign;
  run<6>(ur_like(), states(100000), campaign);
  campaign.check();
}

TEST(Laws, HundredRandomChains) {
  Campaign campaign;
  const int each = (states(100000) + chains - 1) / chains;
  for (unsigned seed = 0; seed < chains; ++seed) run<Eigen::Dynamic>(random_chain(seed), each, campaign);
  campaign.check();
}

}  // namespace
}  // namespace dynid::test
