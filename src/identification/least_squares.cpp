// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/least_squares.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {

double condition_number(const TriangularFactor& factor) {
  if (factor.columns() == 0) return 1.0;
  const Eigen::VectorXd s = Eigen::JacobiSVD<Eigen::MatrixXd>(factor.R()).singularValues();
  const double least = s[s.size() - 1];
  return least > 0.0 ? s[0] / least : std::numeric_limits<double>::infinity();
}

void check_excitation(const TriangularFactor& factor, const std::vector<std::string>& names, double limit) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(factor.R(), Eigen::ComputeFullV);
  const Eigen::VectorXd& s = svd.singularValues();
  const Eigen::Index p = s.size();
  if (s[p - 1] * limit > s[0]) return;
  std::vector<bool> involved(static_cast<std::size_t>(p), false);
  for (Eigen::Index k = 0; k < p; ++k) {
    if (s[k] * limit > s[0]) continue;
    for (Eigen::Index i = 0; i < p; ++i)
      if (std::abs(svd.matrixV()(i, k)) > 0.3) involved[static_cast<std::size_t>(i)] = true;
    Eigen::Index largest = 0;
    svd.matrixV().col(k).cwiseAbs().maxCoeff(&largest);
    involved[static_cast<std::size_t>(largest)] = true;
  }
  std::vector<std::string> weak;
  for (Eigen::Index i = 0; i < p; ++i)
    if (involved[static_cast<std::size_t>(i)]) weak.push_back(names[static_cast<std::size_t>(i)]);
  const double condition = s[p - 1] > 0.0 ? s[0] / s[p - 1] : std::numeric_limits<double>::infinity();
  throw Error("the motion does not excite " + join(weak) + " (condition number " +
              short_number(condition, 3) + ", at most " + short_number(limit, 3) + " can be solved)");
}

Eigen::VectorXd solve(const TriangularFactor& factor) {
  return factor.R().triangularView<Eigen::Upper>().solve(factor.z());
}

Eigen::MatrixXd covariance(const std::vector<RowGroup>& groups, const std::vector<double>& weights) {
  const int p = groups.front().factor.columns();
  TriangularFactor all(p);
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(p, p);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    all.merge(groups[g].factor, weights[g]);
    const Eigen::MatrixXd R = groups[g].factor.R();
    const double w2 = weights[g] * weights[g];
    scatter += w2 * w2 * groups[g].variance * groups[g].correlation * (R.transpose() * R);
  }
  const Eigen::MatrixXd R_all = all.R();
  const Eigen::MatrixXd inverse = R_all.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(p, p));
  const Eigen::MatrixXd G_inverse = inverse * inverse.transpose();
  return G_inverse * scatter * G_inverse;
}

double integrated_autocorrelation(const std::vector<Eigen::VectorXd>& parts) {
  Eigen::Index total = 0;
  double sum = 0.0;
  for (const Eigen::VectorXd& x : parts) {
    total += x.size();
    sum += x.sum();
  }
  if (total < 8) return 1.0;
  const double mean = sum / double(total);
  const auto autocovariance = [&](Eigen::Index lag) {
    double c = 0.0;
    for (const Eigen::VectorXd& x : parts)
      for (Eigen::Index i = 0; i + lag < x.size(); ++i) c += (x[i] - mean) * (x[i + lag] - mean);
    return c / double(total);
  };
  const double c0 = autocovariance(0);
  if (!(c0 > 0.0)) return 1.0;
  double integrated = -1.0;  // pairs (2k, 2k + 1) start with lag 0
  for (Eigen::Index lag = 0; lag + 1 < total / 3; lag += 2) {
    const double pair = autocovariance(lag) + autocovariance(lag + 1);
    if (pair <= 0.0) break;
    integrated += 2.0 * pair / c0;
  }
  return std::max(1.0, integrated);
}

}  // namespace dynid
