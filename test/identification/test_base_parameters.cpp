// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "../dynamics/chains.hpp"
#include "dynid/dynamics/coriolis_matrix.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/identification/base_parameters.hpp"

namespace dynid {
namespace {

std::vector<Robot> arms() {
  std::vector<Robot> arms = {test::panda(), test::ur_like()};
  for (unsigned seed = 0; seed < 20; ++seed) arms.push_back(test::random_chain(seed));
  return arms;
}

TEST(BaseParameters, ReproduceEveryTorque) {
  test::Generator generator(1);
  for (const Robot& robot : arms()) {
    const BaseParameters base = base_parameters(robot);
    const int n = robot.size();
    const Model<> model(robot);
    Workspace<> workspace(model);
    Eigen::MatrixXd Y(n, 10 * n);
    for (int k = 0; k < 20; ++k) {
      const Eigen::VectorXd q = test::random_state(generator, n, 3.0),
                            dq = test::random_state(generator, n, 2.0),
                            ddq = test::random_state(generator, n, 5.0);
      regressor(model, workspace, q, dq, ddq, Y);
      const Eigen::VectorXd pi = robot.parameters();
      const Eigen::VectorXd whole = Y * pi, reduced = Y(Eigen::all, base.columns) * (base.K * pi);
      EXPECT_LT((whole - reduced).norm(), 1e-6 * whole.norm()) << robot.name;
    }
  }
}

/// Rank of columns brought to unit norm; -1 where singular values between 1e-10 and 1e-6 leave it undefined
/// (axes that are all but parallel).
int clear_rank(Eigen::MatrixXd A) {
  const double scale = A.colwise().norm().maxCoeff();
  for (Eigen::Index k = 0; k < A.cols(); ++k) A.col(k) /= std::max(A.col(k).norm(), 1e-9 * scale);
  const Eigen::MatrixXd R =
      Eigen::HouseholderQR<Eigen::MatrixXd>(A).matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>();
  const Eigen::VectorXd s =
      Eigen::JacobiSVD<Eigen::MatrixXd>(R).singularValues() / std::sqrt(double(A.cols()));
  if ((s.array() > 1e-11 && s.array() < 1e-3).any()) return -1;
  return static_cast<int>((s.array() >= 1e-3).count());
}

TEST(BaseParameters, AreAsManyAsTheRankAndTheLeftmost) {
  int tried = 0;
  for (const Robot& robot : arms()) {
    const BaseParameters base = base_parameters(robot);
    const int n = robot.size();
    const Model<> model(robot);
    Workspace<> workspace(model);
    test::Generator generator(2);
    Eigen::MatrixXd stack(60 * n, 10 * n), Y(n, 10 * n);
    for (int k = 0; k < 60; ++k) {
      regressor(model, workspace, test::random_state(generator, n, 3.0),
                test::random_state(generator, n, 2.0), test::random_state(generator, n, 5.0), Y);
      stack.middleRows(k * n, n) = Y;
    }
    const int rank = clear_rank(stack);
    if (rank < 0) continue;
    ++tried;
    EXPECT_EQ(base.size(), rank) << robot.name;
    // Each chosen column adds to the rank of those to its left: none could be swapped for an earlier one.
    for (int i = 0; i < base.size(); ++i) {
      const int c = base.columns[static_cast<std::size_t>(i)];
      const int left = clear_rank(stack.leftCols(c + 1));
      if (left >= 0) {
        ASSERT_EQ(left, i + 1) << robot.name << " " << base.names[static_cast<std::size_t>(i)];
      }
    }
  }
  EXPECT_GE(tried, 5);
}

TEST(BaseParameters, OfThePandaAreThoseOfTheLetter) {
  const BaseParameters base = base_parameters(test::panda());
  // Supplementary Table III.
  const std::vector<std::string> names = {
      "zz1", "mx2", "my2", "xx2", "xy2", "xz2", "yz2", "zz2", "mx3", "my3", "xx3", "xy3", "xz3", "yz3", "zz3",
      "mx4", "my4", "xx4", "xy4", "xz4", "yz4", "zz4", "mx5", "my5", "xx5", "xy5", "xz5", "yz5", "zz5", "mx6",
      "my6", "xx6", "xy6", "xz6", "yz6", "zz6", "mx7", "my7", "xx7", "xy7", "xz7", "yz7", "zz7"};
  EXPECT_EQ(base.names, names);
  EXPECT_EQ(base.expressions[0], "yy2 + zz1");
  EXPECT_EQ(base.expressions[8], "0.0825 m4 + 0.0825 m5 + 0.0825 m6 + 0.0825 m7 + mx3");
}

TEST(BaseParameters, RotorInertiaJoinsTheColumnsItCannotBeToldFrom) {
  const Robot robot = test::panda();
  const BaseParameters base = base_parameters(robot, true);
  EXPECT_EQ(base.parameters(), 77);
  EXPECT_EQ(base.size(), 48);  // ia1 goes with zz1, ia2 with zz2; the five others are seen by themselves
  EXPECT_EQ(base.rigid(), 43);
  EXPECT_NE(base.expressions[0].find("ia1"), std::string::npos) << base.expressions[0];
}

TEST(BaseParameters, NearestParametersHaveTheCoefficientsAndMoveNoFurtherThanTheyMust) {
  const Robot robot = test::panda();
  const BaseParameters base = base_parameters(robot);
  const Eigen::VectorXd start = robot.parameters();
  EXPECT_LT((nearest_parameters(base, base.K * start, start) - start).norm(), 1e-12);
  test::Generator generator(3);
  const Eigen::VectorXd goal = base.K * start + 0.1 * test::random_state(generator, base.size(), 1.0);
  const Eigen::VectorXd nearest = nearest_parameters(base, goal, start);
  EXPECT_LT((base.K * nearest - goal).norm(), 1e-12);
  const Eigen::MatrixXd null = Eigen::FullPivLU<Eigen::MatrixXd>(base.K).kernel();
  EXPECT_LT((null.transpose() * (nearest - start)).norm(), 1e-11);
}

// Eqs. (22), (23): M, c and g from coefficients alone.
TEST(BaseParameters, LagrangianFormNeedsNoStandardParameters) {
  test::Generator generator(5);
  for (const Robot& robot : arms()) {
    const BaseParameters base = base_parameters(robot);
    const int n = robot.size();
    const Model<> bodies(robot);
    const Model<> coefficients =
        bodies.with_parameters(leading_parameters(base, base.K * robot.parameters()));
    Workspace<> ws(bodies);
    const Eigen::VectorXd q = test::random_state(generator, n, 3.0),
                          dq = test::random_state(generator, n, 2.0),
                          ddq = test::random_state(generator, n, 5.0);
    Eigen::MatrixXd M(n, n), S(n, n);
    Eigen::VectorXd g(n), tau(n);
    mass_matrix(coefficients, ws, q, M);
    coriolis_matrix(coefficients, ws, q, dq, S);
    gravity(coefficients, ws, q, g);
    inverse_dynamics(bodies, ws, q, dq, ddq, tau);
    EXPECT_LT((M * ddq + S * dq + g - tau).norm(), 1e-6 * tau.norm()) << robot.name;
  }
}

}  // namespace
}  // namespace dynid
