// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/spectrum.hpp"

namespace dynid {
namespace {

Eigen::VectorXd sine(double frequency, double phase, Eigen::Index size, double rate) {
  Eigen::VectorXd x(size);
  for (Eigen::Index i = 0; i < size; ++i) x[i] = std::sin(2.0 * M_PI * frequency * double(i) / rate + phase);
  return x;
}

/// Gain |H|^2 of an analogue Butterworth filter of order 4, prewarped: what the bilinear transform keeps.
double squared_gain(double f, double cutoff, double rate) {
  const double ratio = std::tan(M_PI * f / rate) / std::tan(M_PI * cutoff / rate);
  return 1.0 / (1.0 + std::pow(ratio, 8));
}

TEST(ZeroPhaseButterworth, HasTheTextbookGainAndNoPhase) {
  const double rate = 500.0, cutoff = 10.0;
  const ZeroPhaseButterworth filter(cutoff, rate);
  for (double f : {0.5, 2.0, 5.0, 10.0, 15.0, 30.0}) {
    const Eigen::VectorXd x = sine(f, 0.7, 10000, rate);
    Eigen::MatrixXd y = x;
    filter.apply(y);
    const auto middle = [](const auto& v) { return v.col(0).segment(2500, 5000); };
    EXPECT_LT((middle(y) - squared_gain(f, cutoff, rate) * middle(x)).cwiseAbs().maxCoeff(), 1e-9)
        << f << " Hz";
  }
}

TEST(ZeroPhaseButterworth, LeavesLinesAloneToTheVeryEnds) {
  const ZeroPhaseButterworth filter(4.0, 200.0);
  const Eigen::MatrixXd line = 3.0 + Eigen::ArrayXd::LinSpaced(400, -1.0, 2.0);
  Eigen::MatrixXd y = line;
  filter.apply(y);
  EXPECT_LT((y - line).cwiseAbs().maxCoeff(), 2e-3);
  Eigen::MatrixXd constant = Eigen::MatrixXd::Constant(50, 2, -7.25);
  filter.apply(constant);
  EXPECT_LT((constant.array() + 7.25).abs().maxCoeff(), 1e-12);
}

TEST(ZeroPhaseButterworth, CommutesWithTimeReversal) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd x(3000, 1);
  for (double& v : x.reshaped()) v = normal(random);
  Eigen::MatrixXd forwards = x, backwards = x.colwise().reverse();
  const ZeroPhaseButterworth filter(20.0, 1000.0);
  filter.apply(forwards);
  filter.apply(backwards);
  EXPECT_LT((forwards - backwards.colwise().reverse()).middleRows(600, 1800).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ZeroPhaseButterworth, KernelIsTheFilter) {
  const double rate = 200.0;
  const ZeroPhaseButterworth filter(8.0, rate);
  const Eigen::MatrixXd x = sine(3.0, 0.2, 2000, rate) + 0.5 * sine(12.0, 1.0, 2000, rate);
  Eigen::MatrixXd y = x;
  filter.apply(y);
  const Eigen::MatrixXd z = DecimatingFilter(filter.half_kernel(), 1).apply(x);
  EXPECT_LT((y - z).middleRows(400, 1200).cwiseAbs().maxCoeff(), 3e-5);
}

TEST(ZeroPhaseButterworth, RefusesCutOffsItCannotHave) {
  EXPECT_THROW(ZeroPhaseButterworth(0.0, 100.0), Error);
  EXPECT_THROW(ZeroPhaseButterworth(50.0, 100.0), Error);
  EXPECT_THROW(ZeroPhaseButterworth(std::nan(""), 100.0), Error);
}

TEST(DecimatingFilter, IsLinearUpToTheEnds) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd A(700, 4);
  for (double& v : A.reshaped()) v = normal(random);
  const Eigen::Vector4d x(1.0, -2.0, 0.5, 3.0);
  const DecimatingFilter filter(ZeroPhaseButterworth(5.0, 125.0).half_kernel(), 10);
  EXPECT_LT((filter.apply(A) * x - filter.apply(A * x)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(filter.apply(A).rows(), filter.outputs(700));
  EXPECT_LT((filter.apply(Eigen::MatrixXd::Ones(700, 1)).array() - 1.0).abs().maxCoeff(), 1e-12);
}

TEST(DecimatingFilter, WindowsGiveWhatTheWholeSignalGives) {
  const Eigen::MatrixXd x = sine(1.3, 0.4, 900, 100.0);
  const DecimatingFilter filter(ZeroPhaseButterworth(4.0, 100.0).half_kernel(), 7);
  const Eigen::MatrixXd whole = filter.apply(x);
  for (Eigen::Index k = 0; k < whole.rows(); ++k) {
    const Eigen::Index from = std::max<Eigen::Index>(0, filter.centre(k) - filter.reach());
    const Eigen::Index to = std::min<Eigen::Index>(899, filter.centre(k) + filter.reach());
    EXPECT_EQ(filter.output(k, x.middleRows(from, to - from + 1), from, 900)[0], whole(k, 0)) << k;
  }
}

TEST(Differentiate, IsExactForParabolas) {
  const double rate = 50.0;
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(101, 0.0, 2.0);
  const Eigen::MatrixXd x = (1.0 + 2.0 * t.array() + 3.0 * t.array().square()).matrix();
  EXPECT_LT((differentiate(x, rate).col(0) - (2.0 + 6.0 * t.array()).matrix()).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_THROW(differentiate(Eigen::MatrixXd::Zero(2, 1), rate), Error);
}

TEST(Interpolate, IsExactForParabolasOnAnyStampsAndHoldsTheEnds) {
  std::mt19937_64 random(11);
  Eigen::VectorXd t(40);
  double now = 0.0;
  for (double& x : t) x = (now += 0.01 + 0.05 * double(random() % 1000) / 1000.0);
  const auto curve = [](double s) { return 1.0 - 2.0 * s + 0.5 * s * s; };
  const Eigen::VectorXd x = t.unaryExpr(curve);
  const Eigen::VectorXd grid = Eigen::VectorXd::LinSpaced(300, t[1], t[38]);
  EXPECT_LT((interpolate(t, x, grid) - grid.unaryExpr(curve)).segment(10, 280).cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_LT((interpolate(t, x, t) - x).cwiseAbs().maxCoeff(), 1e-14);
  const Eigen::Vector2d outside(t[0] - 1.0, t[39] + 1.0);
  EXPECT_EQ(interpolate(t, x, outside), Eigen::Vector2d(x[0], x[39]));
}

TEST(Welch, PowerIsVarianceAndSitsAtTheRightFrequency) {
  const double rate = 100.0;
  const Eigen::VectorXd x = 2.0 * sine(6.25, 0.0, 8192, rate);
  const Spectrum s = welch(x, rate, 10.0);
  Eigen::Index peak = 0;
  s.density.maxCoeff(&peak);
  EXPECT_NEAR(s.frequency[peak], 6.25, 0.1);
  EXPECT_NEAR(s.density.sum() * s.frequency[1], 2.0, 0.02);  // Parseval: amplitude^2 / 2
}

}  // namespace
}  // namespace dynid
