// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "dynid/base/statistics.hpp"

namespace dynid {
namespace {

TEST(Statistics, HalfOfTheSamplesAreNotAboveTheMedian) {
  std::mt19937_64 random(31);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> x(1 + random() % 30);
    for (double& value : x) value = double(random() % 10);  // ties
    const double m = median(x);
    const auto count = [&](auto is) { return std::size_t(std::count_if(x.begin(), x.end(), is)); };
    EXPECT_GE(2 * count([&](double v) { return v <= m; }), x.size());
    EXPECT_GE(2 * count([&](double v) { return v >= m; }), x.size());
    EXPECT_EQ(median(Eigen::Map<Eigen::VectorXd>(x.data(), Eigen::Index(x.size()))), m);
  }
  EXPECT_EQ(median(std::vector<double>{4.0, 1.0, 3.0, 2.0}), 3.0);  // the upper of the two
  EXPECT_EQ(median(std::vector<double>{}), 0.0);
}

TEST(Statistics, MediansOfColumns) {
  Eigen::MatrixXd x(3, 2);
  x << 5, -1, 1, -3, 2, -2;
  EXPECT_EQ(column_medians(x), Eigen::Vector2d(2.0, -2.0));
  EXPECT_EQ(median(x.col(1).cwiseAbs()), 2.0);
}

TEST(Statistics, MedianDeviationIsTheNormalOnesSigma) {
  std::mt19937_64 random(32);
  std::normal_distribution<double> normal(0.0, 3.0);
  std::vector<double> x(40001);
  for (double& value : x) value = std::abs(normal(random));
  EXPECT_NEAR(deviations_to_sigma * median(x), 3.0, 0.06);  // 4 standard errors
}

TEST(Statistics, QuantilesCountWeights) {
  std::vector<WeightedSample> x;
  for (int k = 10; k >= 1; --k) x.push_back({double(k), 1.0});
  EXPECT_EQ(quantile(x, 0.9), 9.0);
  EXPECT_EQ(quantile(x, 1.0), 10.0);
  EXPECT_EQ(quantile(x, 0.0), 1.0);
  // A sample of weight two is two samples.
  EXPECT_EQ(quantile({{1.0, 2.0}, {2.0, 1.0}}, 0.6), quantile({{1.0, 1.0}, {1.0, 1.0}, {2.0, 1.0}}, 0.6));
  EXPECT_EQ(quantile({{1.0, 1.0}, {2.0, 3.0}}, 0.5), 2.0);
  EXPECT_EQ(quantile({}, 0.5), 0.0);
}

}  // namespace
}  // namespace dynid
