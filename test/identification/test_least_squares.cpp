// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/identification/least_squares.hpp"

namespace dynid {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd A(rows, columns);
  for (double& x : A.reshaped()) x = normal(random);
  return A;
}

TEST(TriangularFactor, IsTheNormalEquationsWithoutTheirSquaring) {
  const Eigen::MatrixXd Ab = random_matrix(5000, 13, 1);
  TriangularFactor factor(12);
  for (Eigen::Index i = 0; i < 5000; i += 777)
    factor.add(Ab.middleRows(i, std::min<Eigen::Index>(777, 5000 - i)));
  EXPECT_EQ(factor.rows(), 5000);
  const auto A = Ab.leftCols(12);
  const auto b = Ab.col(12);
  EXPECT_LT((factor.R().transpose() * factor.R() - A.transpose() * A).norm(), 1e-9);
  const Eigen::VectorXd x = A.colPivHouseholderQr().solve(b);
  EXPECT_LT((solve(factor) - x).norm(), 1e-12);
  EXPECT_NEAR(factor.residual(), (A * x - b).squaredNorm(), 1e-9);
  EXPECT_NEAR(factor.energy(), b.squaredNorm(), 1e-9);
}

TEST(TriangularFactor, MergesInAnyPartsAndScattersAndRestricts) {
  const Eigen::MatrixXd Ab = random_matrix(900, 6, 2);
  TriangularFactor whole(5), first(5), second(5);
  whole.add(Ab);
  first.add(Ab.topRows(311));
  second.add(Ab.bottomRows(589));
  first.merge(second);
  EXPECT_EQ(first.rows(), 900);
  EXPECT_LT((solve(first) - solve(whole)).norm(), 1e-13);
  EXPECT_NEAR(first.residual(), whole.residual(), 1e-10);

  const TriangularFactor wide = whole.scattered({1, 2, 4, 5, 7}, 8);
  EXPECT_LT((wide.R()(Eigen::all, {1, 2, 4, 5, 7}).squaredNorm() - whole.R().squaredNorm()), 1e-9);
  EXPECT_EQ(wide.R().col(0).norm() + wide.R().col(3).norm() + wide.R().col(6).norm(), 0.0);
  const TriangularFactor part = whole.restricted({0, 3});
  const Eigen::VectorXd x = Ab(Eigen::all, {0, 3}).colPivHouseholderQr().solve(Ab.col(5));
  EXPECT_LT((solve(part) - x).norm(), 1e-12);
  EXPECT_EQ(part.rows(), 900);
}

TEST(TriangularFactor, KeepsHalfTheDigitsThatNormalEquationsLose) {
  Eigen::MatrixXd Ab = random_matrix(400, 5, 3);
  Ab.col(3) = Ab.col(2) + 1e-7 * Ab.col(3);  // A^T A would be singular to rounding
  const Eigen::Vector4d truth(1.0, -2.0, 3.0, 4.0);
  Ab.col(4) = Ab.leftCols(4) * truth;
  TriangularFactor factor(4);
  factor.add(Ab);
  EXPECT_LT((solve(factor) - truth).norm(), 1e-6);
}

TEST(TriangularFactor, RefusesRowsOfAnotherWidth) {
  TriangularFactor factor(3);
  EXPECT_THROW(factor.add(Eigen::MatrixXd::Zero(2, 3)), Error);
}

TEST(LeastSquares, UnexcitedCoefficientsAreNamed) {
  Eigen::MatrixXd Ab = random_matrix(100, 5, 4);
  Ab.col(1) *= 1e-7;
  TriangularFactor factor(4);
  factor.add(Ab);
  try {
    check_excitation(factor, {"zz1", "mx2", "my2", "xx2"});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("does not excite mx2 ("), std::string::npos) << error.what();
  }
}

TEST(LeastSquares, CovarianceOfIndependentRowsIsTheTextbooks) {
  const Eigen::MatrixXd A = random_matrix(300, 4, 5);
  Eigen::MatrixXd Ab(300, 5);
  Ab << A, random_matrix(300, 1, 6);
  RowGroup group{TriangularFactor(4), 0.7, 1.0};
  group.factor.add(Ab);
  const Eigen::MatrixXd textbook = 0.7 * (A.transpose() * A).inverse();
  EXPECT_LT((covariance({group}, {1.0}) - textbook).norm(), 1e-12);
  EXPECT_LT((covariance({group}, {3.0}) - textbook).norm(), 1e-12) << "a common weight changes nothing";
}

/// Errors of coefficients over many draws of AR(1) noise, in units of the standard deviation that is
/// reported.
TEST(LeastSquares, StandardDeviationsHoldForCorrelatedNoise) {
  const Eigen::Index rows = 1500;
  Eigen::MatrixXd A(rows, 3);
  for (Eigen::Index i = 0; i < rows; ++i)
    A.row(i) << 1.0, std::sin(0.01 * double(i)), std::cos(0.023 * double(i));
  double honest = 0.0, textbook = 0.0;
  const int draws = 200;
  for (unsigned seed = 0; seed < draws; ++seed) {
    const Eigen::VectorXd white = random_matrix(rows, 1, 100 + seed);
    Eigen::VectorXd noise(rows);
    double state = 0.0;
    for (Eigen::Index i = 0; i < rows; ++i) noise[i] = state = 0.9 * state + white[i];
    Eigen::MatrixXd Ab(rows, 4);
    Ab << A, noise;
    RowGroup group{TriangularFactor(3), 0.0, 1.0};
    group.factor.add(Ab);
    const Eigen::VectorXd x = solve(group.factor), e = A * x - noise;
    group.variance = e.squaredNorm() / double(rows - 3);
    textbook += (x.array().square() / covariance({group}, {1.0}).diagonal().array()).mean() / draws;
    group.correlation = integrated_autocorrelation({e});
    honest += (x.array().square() / covariance({group}, {1.0}).diagonal().array()).mean() / draws;
  }
  EXPECT_NEAR(honest, 1.0, 0.35);
  EXPECT_GT(textbook, 10.0) << "independent rows would claim four times the accuracy";
}

}  // namespace
}  // namespace dynid
