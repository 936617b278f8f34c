// SPDX-License-Identifier: Apache-2.0
#include "fit_problem.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

std::size_t at(int k) { return static_cast<std::size_t>(k); }

}  // namespace

std::string tag(const char* symbol, int joint) { return symbol + std::to_string(joint + 1); }

FitProblem::FitProblem(const BaseParameters& base, std::vector<RegressionRows> rows, Eigen::Index samples,
                       const IdentifyOptions& options)
    : base_(base),
      rows_(std::move(rows)),
      options_(options),
      samples_(samples),
      n_(rows_.front().joints()),
      own_(options.friction == FrictionLaw::none ? 0 : 3),
      columns_(base.size() + n_ * own_) {}

std::vector<std::string> FitProblem::names() const {
  std::vector<std::string> names = base_.names;
  for (int j = 0; j < n_ && own_ > 0; ++j)
    for (const char* symbol : {"fv", "fc", "fo"}) names.push_back(tag(symbol, j));
  return names;
}

Eigen::VectorXd FitProblem::difference(const RegressionFit& fit, const RegressionRows& rows, int j) const {
  return rows.tau().col(j) - rows.rigid(j) * fit.x.head(base_.size());
}

std::vector<Eigen::MatrixXd> FitProblem::residuals(const RegressionFit& fit,
                                                   const std::vector<RegressionRows>& rows) const {
  std::vector<Eigen::MatrixXd> out;
  for (const RegressionRows& r : rows) {
    Eigen::MatrixXd e(r.size(), n_);
    for (int j = 0; j < n_; ++j) {
      e.col(j) = -difference(fit, r, j);
      if (fit.sigmoid[at(j)]) {
        const JointFriction& f = fit.sigmoid[at(j)]->friction;
        e.col(j) += r.velocity_columns(
            j, 1, [&](double dq) { return Eigen::RowVectorXd::Constant(1, friction_torque(f, dq)); });
      } else if (own_ > 0) {
        e.col(j) += linear_columns(r, j) * fit.x.segment(first(j), own_);
      }
    }
    out.push_back(std::move(e));
  }
  return out;
}

FitQuality FitProblem::quality(const RegressionFit& fit, const std::vector<RegressionRows>& rows,
                               const RowWeights& weights, const std::string& source) const {
  FitQuality q;
  q.source = source;
  q.rmse = Eigen::VectorXd::Zero(n_);
  double energy = 0.0;
  const std::vector<Eigen::MatrixXd> e = residuals(fit, rows);
  for (std::size_t l = 0; l < rows.size(); ++l) {
    for (Eigen::Index i = 0; i < e[l].rows(); ++i) {
      if (weights[l](i, 0) == 0.0) continue;
      ++q.rows;
      q.rmse += e[l].row(i).transpose().cwiseAbs2();
      energy += rows[l].tau().row(i).squaredNorm();
    }
  }
  q.relative_error_percent = 100.0 * std::sqrt(q.rmse.sum() / energy);
  q.rmse = (q.rmse / double(std::max<Eigen::Index>(q.rows, 1))).cwiseSqrt();
  return q;
}

Eigen::MatrixXd FitProblem::linear_columns(const RegressionRows& r, int j) const {
  LinearFriction f;
  f.velocity_scale = options_.velocity_scale;
  return r.velocity_columns(j, 3, [&](double dq) { return Eigen::RowVectorXd(friction_regressor(f, dq)); });
}

std::vector<RowGroup> FitProblem::groups(const RowWeights& weights) const {
  const int rigid = base_.size();
  std::vector<RowGroup> groups;
  for (int j = 0; j < n_; ++j) {
    TriangularFactor local(rigid + own_);
    for (std::size_t l = 0; l < rows_.size(); ++l) {
      const RegressionRows& r = rows_[l];
      Eigen::MatrixXd block(r.size(), rigid + own_ + 1);
      block.leftCols(rigid) = r.rigid(j);
      if (own_ > 0) block.middleCols(rigid, own_) = linear_columns(r, j);
      block.rightCols<1>() = r.tau().col(j);
      block = weights[l].col(j).asDiagonal() * block;
      local.add(block);
    }
    std::vector<int> where(at(rigid + own_));
    std::iota(where.begin(), where.begin() + rigid, 0);
    std::iota(where.begin() + rigid, where.end(), first(j));
    groups.push_back({local.scattered(where, columns_), 1.0, 1.0});
  }
  return groups;
}

TriangularFactor merged(const std::vector<RowGroup>& groups, const std::vector<double>& weights) {
  TriangularFactor all(groups.front().factor.columns());
  for (std::size_t g = 0; g < groups.size(); ++g) all.merge(groups[g].factor, weights[g]);
  return all;
}

}  // namespace dynid::detail
