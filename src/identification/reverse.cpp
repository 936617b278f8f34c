// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/reverse.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <numeric>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/inertia_stack_regressor.hpp"
#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

constexpr int held_out_every = 5;

bool first_axis_is_vertical(const Robot& robot) {
  const Joint& first = robot.joints.front();
  const Eigen::Vector3d axis = first.origin.linear() * first.axis;
  return first.type != JointType::prismatic &&
         axis.cross(robot.gravity).norm() <= 1e-9 * robot.gravity.norm();
}

/// Calls `row(sample, regressor row, value)` for every row of eq. (19) that is used, sample by sample.
class Stack {
 public:
  Stack(const Robot& robot, const BaseParameters& base, const ModelSamples& samples)
      : base_(base), samples_(samples), model_(robot), n_(robot.size()) {
    for (int k = 0; k < static_cast<int>(samples.s.cols()); ++k)
      if (k != n_ * (n_ + 1) / 2 || !first_axis_is_vertical(robot)) rows_.push_back(k);
  }

  const std::vector<int>& rows() const { return rows_; }

  /// [Y_s,R | s] of the chosen rows of sample i.
  Eigen::MatrixXd block(Eigen::Index i) const {
    Workspace<> workspace(model_);
    Eigen::MatrixXd Y(samples_.s.cols(), base_.standard);
    const Eigen::VectorXd q = samples_.q.row(i);
    inertia_stack_regressor(model_, workspace, q, Y);
    Eigen::MatrixXd out(static_cast<Eigen::Index>(rows_.size()), base_.size() + 1);
    out.leftCols(base_.size()) = Y(rows_, base_.columns);
    out.rightCols<1>() = samples_.s(i, rows_).transpose();
    return out;
  }

  TriangularFactor factor(const std::function<bool(Eigen::Index)>& take) const {
    TriangularFactor all(base_.size());
    constexpr Eigen::Index most = 64;
    const auto per_sample = static_cast<Eigen::Index>(rows_.size());
    Eigen::MatrixXd stack(most * per_sample, base_.size() + 1);
    Eigen::Index filled = 0;
    for (Eigen::Index i = 0; i < samples_.q.rows(); ++i) {
      if (take(i)) stack.middleRows(filled++ * per_sample, per_sample) = block(i);
      if (filled == most || (i + 1 == samples_.q.rows() && filled > 0)) {
        all.add(stack.topRows(filled * per_sample));
        filled = 0;
      }
    }
    return all;
  }

 private:
  const BaseParameters& base_;
  const ModelSamples& samples_;
  Model<> model_;
  int n_;
  std::vector<int> rows_;
};

struct Errors {
  double relative_percent = 0.0;
  Eigen::VectorXd gravity, inertia;
};

Errors errors(const Stack& stack, const ModelSamples& samples, int n, const Eigen::VectorXd& x,
              const std::function<bool(Eigen::Index)>& take) {
  Errors out;
  out.gravity = out.inertia = Eigen::VectorXd::Zero(n);
  double error = 0.0, energy = 0.0, count = 0.0;
  for (Eigen::Index i = 0; i < samples.q.rows(); ++i) {
    if (!take(i)) continue;
    count += 1.0;
    const Eigen::MatrixXd block = stack.block(i);
    const Eigen::VectorXd s = block.rightCols<1>();
    const Eigen::VectorXd e = block.leftCols(x.size()) * x - s;
    error += e.squaredNorm();
    energy += s.squaredNorm();
    for (std::size_t k = 0; k < stack.rows().size(); ++k) {
      const double square = e[static_cast<Eigen::Index>(k)] * e[static_cast<Eigen::Index>(k)];
      int row = stack.rows()[k];
      if (row >= n * (n + 1) / 2) {
        out.gravity[row - n * (n + 1) / 2] += square;
        continue;
      }
      int i_row = 0;
      while (row > i_row) row -= ++i_row;
      out.inertia[i_row] += square / (i_row + 1);
    }
  }
  out.relative_percent = 100.0 * std::sqrt(error / energy);
  out.gravity = (out.gravity / count).cwiseSqrt();
  out.inertia = (out.inertia / count).cwiseSqrt();
  return out;
}

struct Pruned {
  std::vector<int> kept;
  Eigen::VectorXd x;           // all, 0 where dropped
  Eigen::MatrixXd covariance;  // all, 0 where dropped
};

Pruned solve_pruned(const TriangularFactor& factor, double prune_percent) {
  Pruned out;
  out.kept.resize(static_cast<std::size_t>(factor.columns()));
  std::iota(out.kept.begin(), out.kept.end(), 0);
  while (true) {
    const TriangularFactor restricted = factor.restricted(out.kept);
    const Eigen::VectorXd x = solve(restricted);
    const double free = double(std::max<Eigen::Index>(1, factor.rows() - restricted.columns()));
    const Eigen::MatrixXd covariance =
        dynid::covariance({{restricted, restricted.residual() / free, 1.0}}, {1.0});
    Eigen::Index worst = -1;
    double most = prune_percent;
    for (Eigen::Index k = 0; k < x.size() && prune_percent > 0.0; ++k) {
      const double percent = 100.0 * std::sqrt(covariance(k, k)) / std::abs(x[k]);
      if (percent <= most) continue;
      most = percent;
      worst = k;
    }
    if (worst < 0) {
      out.x = Eigen::VectorXd::Zero(factor.columns());
      out.x(out.kept) = x;
      out.covariance = Eigen::MatrixXd::Zero(factor.columns(), factor.columns());
      out.covariance(out.kept, out.kept) = covariance;
      return out;
    }
    out.kept.erase(out.kept.begin() + worst);
  }
}

}  // namespace

ModelSamples read_model_samples(const std::string& path, int joints) {
  const Table table = read_table(path);
  const int found = table.count("q");
  if (found != joints)
    throw Error(path + ": the samples have " + std::to_string(found) + " joints (q1..q" +
                std::to_string(found) + "), the robot has " + std::to_string(joints));
  ModelSamples samples;
  samples.source = path;
  samples.q = table.group("q", joints, true);
  samples.s.resize(samples.q.rows(), joints * (joints + 1) / 2 + joints);
  Eigen::Index column = 0;
  for (int i = 1; i <= joints; ++i) {
    for (int k = 1; k <= i; ++k) {
      std::string name = "m" + std::to_string(i);
      name += std::to_string(k);
      const int at = table.find(name);
      if (at < 0) throw Error(path + ": column " + name + " is missing");
      samples.s.col(column++) = table.values.col(at);
    }
  }
  samples.s.rightCols(joints) = table.group("g", joints, true);
  return samples;
}

ReverseIdentification reverse_engineer(const Robot& robot, const ModelSamples& samples,
                                       const ReverseOptions& options) {
  const int n = robot.size();
  if (samples.q.cols() != n)
    throw Error(samples.source + ": the samples have " + std::to_string(samples.q.cols()) +
                " joints, the robot has " + std::to_string(n));
  ReverseIdentification out;
  out.base = base_parameters(robot);
  const int r = out.base.size();
  if (samples.q.rows() * n < 2 * r)  // eq. (18)
    throw Error(samples.source + ": " + std::to_string(samples.q.rows()) +
                " configurations are too few for " + std::to_string(r) + " coefficients");

  const Stack stack(robot, out.base, samples);
  const auto every = [](Eigen::Index) { return true; };
  const auto held_out = [](Eigen::Index i) { return i % held_out_every == held_out_every - 1; };
  const TriangularFactor factor = stack.factor(every);
  try {
    check_excitation(factor, out.base.names);
  } catch (const Error& error) {
    throw Error(samples.source + ": " + error.what());
  }
  out.rank = r;
  out.condition_number = condition_number(factor);
  const Pruned all = solve_pruned(factor, 0.0), pruned = solve_pruned(factor, options.prune_percent);
  out.values = pruned.x;
  out.covariance = pruned.covariance;
  const Errors fit = errors(stack, samples, n, out.values, every);
  out.relative_error_percent = fit.relative_percent;
  out.rmse = fit.gravity;
  out.rmse_inertia = fit.inertia;
  const Pruned part =
      solve_pruned(stack.factor([&](Eigen::Index i) { return !held_out(i); }), options.prune_percent);
  const Errors validation = errors(stack, samples, n, part.x, held_out);
  out.validation_relative_error_percent = validation.relative_percent;
  out.validation_rmse = validation.gravity;

  std::vector<bool> kept(static_cast<std::size_t>(r), false);
  for (int k : pruned.kept) kept[static_cast<std::size_t>(k)] = true;
  for (int k = 0; k < r; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Pruned& from = kept[i] ? pruned : all;
    out.coefficients.push_back(
        {out.base.names[i], out.base.expressions[i], from.x[k],
         100.0 * std::sqrt(from.covariance(k, k)) / std::max(std::abs(from.x[k]), 1e-300), kept[i]});
  }
  out.robot = robot;
  out.robot.set_parameters(nearest_parameters(out.base, out.values, parameter_vector(robot, out.base)));
  for (Joint& joint : out.robot.joints)
    joint.friction = {};  // M and g say nothing of it: see identify_friction()
  return out;
}

}  // namespace dynid
