// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/identify.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <utility>

#include "dynid/base/error.hpp"
#include "dynid/friction/fit.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/identification/regression.hpp"

namespace dynid {
namespace {

std::string tag(const char* symbol, int joint) { return symbol + std::to_string(joint + 1); }

/// Square roots of row weights, N x n, one a log; 0 leaves a row out.
using RowWeights = std::vector<Eigen::MatrixXd>;

/// Eq. (25) with viscous term and offset on one joint, the rigid body being given: fv dq + fo + phi(dq).
struct SigmoidJoint {
  JointFriction friction;
  Eigen::Matrix<double, 5, 5> covariance;  ///< of fv, fo, phi1, phi2, phi3
};

/// Least squares with eq. (24) or no friction; then, on some joints, eq. (25) instead.
struct Fit {
  std::vector<RowGroup> groups;  // one a joint, all columns
  std::vector<double> weights;   // one a joint
  TriangularFactor unweighted;
  Eigen::VectorXd x;  // rigid body, then friction joint by joint; 0 where dropped
  std::vector<int> kept;
  Eigen::MatrixXd covariance;  // of the kept
  Eigen::VectorXd noise, correlation;
  std::vector<std::optional<SigmoidJoint>> sigmoid;
};

class Problem {
 public:
  Problem(const BaseParameters& base, std::vector<RegressionRows> rows, Eigen::Index samples,
          const IdentifyOptions& options)
      : base_(base),
        rows_(std::move(rows)),
        options_(options),
        samples_(samples),
        n_(rows_.front().joints()),
        own_(options.friction == FrictionLaw::none ? 0 : 3),
        columns_(base.size() + n_ * own_) {}

  const std::vector<RegressionRows>& rows() const { return rows_; }
  int columns() const { return columns_; }
  /// First friction column of joint j.
  int first(int j) const { return base_.size() + j * own_; }

  RowWeights all_rows() const {
    RowWeights weights;
    for (const RegressionRows& r : rows_) weights.emplace_back(Eigen::MatrixXd::Ones(r.size(), n_));
    return weights;
  }

  /// `weights` without the blocks of `folds` of every log that `out` chooses, nor the rows that share data
  /// with them.
  RowWeights without(const RowWeights& weights, int folds, const std::function<bool(int)>& out) const {
    RowWeights inside = weights;
    for (std::size_t l = 0; l < rows_.size(); ++l) {
      const Eigen::Index size = rows_[l].size(), margin = rows_[l].overlap();
      for (Eigen::Index i = 0; i < size; ++i) {
        const Eigen::Index before = std::max<Eigen::Index>(0, i - margin),
                           after = std::min(size - 1, i + margin);
        for (Eigen::Index k : {before, i, after})
          if (out(static_cast<int>(k * folds / size))) inside[l].row(i).setZero();
      }
    }
    return inside;
  }

  /// `weights` within these blocks alone.
  RowWeights only(const RowWeights& weights, int folds, const std::function<bool(int)>& out) const {
    RowWeights outside = weights;
    for (std::size_t l = 0; l < rows_.size(); ++l)
      for (Eigen::Index i = 0; i < rows_[l].size(); ++i)
        if (!out(static_cast<int>(i * folds / rows_[l].size()))) outside[l].row(i).setZero();
    return outside;
  }

  std::vector<std::string> names() const {
    std::vector<std::string> names = base_.names;
    for (int j = 0; j < n_ && own_ > 0; ++j)
      for (const char* symbol : {"fv", "fc", "fo"}) names.push_back(tag(symbol, j));
    return names;
  }

  /// Least squares by the method of the options, noise and correlation of each joint, pruning.
  Fit fit(const RowWeights& weights) const {
    Fit fit;
    fit.sigmoid.resize(at(n_));
    fit.groups = groups(weights);
    fit.unweighted = merged(fit.groups, std::vector<double>(fit.groups.size(), 1.0));
    check_excitation(fit.unweighted, names());
    fit.weights = joint_weights(fit.groups, options_.method, weights);
    fit.x = solve(merged(fit.groups, fit.weights));
    if (options_.method == Method::irls) reweight(fit, weights);
    set_noise(fit, weights);
    prune(fit, weights);
    return fit;
  }

  /// What is left of joint j's torque in each log without its friction, N each.
  Eigen::VectorXd difference(const Fit& fit, const RegressionRows& rows, int j) const {
    return rows.tau().col(j) - rows.rigid(j) * fit.x.head(base_.size());
  }

  /// Eq. (25) with viscous term and offset for the differences of joint j (Section IV-B): everything but
  /// (phi2, phi3) is linear and solved for at each trial (variable projection); the columns pass through the
  /// filter of the rows.
  SigmoidJoint fit_sigmoid(const Fit& fit, const RowWeights& weights, int j) const {
    Eigen::Index total = 0;
    for (const RegressionRows& r : rows_) total += r.size();
    Eigen::VectorXd d(total), dq(total), w(total);
    Eigen::Index row = 0;
    for (std::size_t l = 0; l < rows_.size(); ++l) {
      const Eigen::Index size = rows_[l].size();
      d.segment(row, size) = difference(fit, rows_[l], j);
      dq.segment(row, size) = rows_[l].velocity(j);
      w.segment(row, size) = weights[l].col(j);
      row += size;
    }
    const double sharpest =
        2.0 / std::max(options_.velocity_scale, 0.005);  // no sharper than the smoothed sign
    const double fastest = std::max(dq.cwiseAbs().maxCoeff(), 1e-3);
    struct Trial {
      double cost = std::numeric_limits<double>::infinity();
      Eigen::Vector3d x;  // fv, fo, phi1
      Eigen::MatrixXd columns;
    };
    const auto project = [&](double phi2, double phi3) {
      Trial trial;
      trial.columns = sigmoid_columns(j, {1.0, phi2, phi3});
      const Eigen::MatrixXd A = w.asDiagonal() * trial.columns.leftCols<3>();
      const Eigen::VectorXd b = w.cwiseProduct(d);
      trial.x = A.colPivHouseholderQr().solve(b);
      trial.cost = (A * trial.x - b).squaredNorm();
      return trial;
    };
    const auto cost = [&](const std::vector<double>& p) { return project(std::exp(p[0]), p[1]).cost; };
    using Cost = decltype(cost);
    std::vector<double> best;
    double least = std::numeric_limits<double>::infinity();
    // The middle of the curve sits near zero velocity; its sharpness may be anything between a line and a
    // step.
    for (double start : {0.1 * sharpest, 0.3 * sharpest, 0.9 * sharpest}) {
      nlopt::opt search(nlopt::LN_BOBYQA, 2);
      search.set_min_objective([](const std::vector<double>& p, std::vector<double>&,
                                  void* data) { return (*static_cast<Cost*>(data))(p); },
                               const_cast<void*>(static_cast<const void*>(&cost)));
      search.set_lower_bounds(std::vector<double>{std::log(0.5 / fastest), -0.5 * fastest});
      search.set_upper_bounds(std::vector<double>{std::log(sharpest), 0.5 * fastest});
      search.set_ftol_rel(1e-8);
      search.set_maxeval(150);
      std::vector<double> p = {std::clamp(std::log(start), std::log(0.5 / fastest), std::log(sharpest)), 0.0};
      double value = 0.0;
      try {
        search.optimize(p, value);
      } catch (const nlopt::roundoff_limited&) {  // as good as it gets: p holds the best point
      }
      value = cost(p);
      if (value < least) {
        least = value;
        best = p;
      }
    }
    const Trial trial = project(std::exp(best[0]), best[1]);
    SigmoidJoint out;
    out.friction.linear = {trial.x[0], 0.0, trial.x[1], 0.0};
    out.friction.sigmoid = {trial.x[2], std::exp(best[0]), best[1]};
    Eigen::MatrixXd J = w.asDiagonal() * trial.columns;
    J.rightCols<2>() *= trial.x[2];  // they were made with phi1 = 1
    const double variance =
        fit.correlation[j] * trial.cost / std::max(1.0, double((w.array() != 0.0).count()) - 5.0);
    out.covariance =
        variance * Eigen::MatrixXd(J.transpose() * J).completeOrthogonalDecomposition().pseudoInverse();
    return out;
  }

  /// Rows predicted minus rows measured, N x n, one a log.
  std::vector<Eigen::MatrixXd> residuals(const Fit& fit, const std::vector<RegressionRows>& rows) const {
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

  FitQuality quality(const Fit& fit, const std::vector<RegressionRows>& rows, const RowWeights& weights,
                     const std::string& source) const {
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

  /// Solution and covariance with every column in.
  std::pair<Eigen::VectorXd, Eigen::MatrixXd> unpruned(const Fit& fit) const {
    return {solve(merged(fit.groups, fit.weights)), dynid::covariance(fit.groups, fit.weights)};
  }

 private:
  static std::size_t at(int k) { return static_cast<std::size_t>(k); }

  Eigen::MatrixXd linear_columns(const RegressionRows& r, int j) const {
    LinearFriction f;
    f.velocity_scale = options_.velocity_scale;
    return r.velocity_columns(j, 3, [&](double dq) { return Eigen::RowVectorXd(friction_regressor(f, dq)); });
  }

  /// d tau_f / d(fv, fo, phi1, phi2, phi3) of joint j over all logs.
  Eigen::MatrixXd sigmoid_columns(int j, const SigmoidFriction& phi) const {
    Eigen::MatrixXd columns(0, 5);
    for (const RegressionRows& r : rows_) {
      const Eigen::Index row = columns.rows();
      columns.conservativeResize(row + r.size(), Eigen::NoChange);
      columns.bottomRows(r.size()) = r.velocity_columns(j, 5, [&](double dq) {
        Eigen::RowVectorXd values(5);
        values << dq, 1.0, friction_regressor(phi, dq);
        return values;
      });
    }
    return columns;
  }

  /// One factor a joint, of all columns.
  std::vector<RowGroup> groups(const RowWeights& weights) const {
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

  static TriangularFactor merged(const std::vector<RowGroup>& groups, const std::vector<double>& weights) {
    TriangularFactor all(groups.front().factor.columns());
    for (std::size_t g = 0; g < groups.size(); ++g) all.merge(groups[g].factor, weights[g]);
    return all;
  }

  Eigen::Index rows_in(const RowWeights& weights, int j) const {
    Eigen::Index rows = 0;
    for (const Eigen::MatrixXd& w : weights) rows += (w.col(j).array() != 0.0).count();
    return rows;
  }

  /// Weights of method wls for given factors; ones for ols.
  std::vector<double> joint_weights(const std::vector<RowGroup>& groups, Method method,
                                    const RowWeights& row_weights) const {
    std::vector<double> weights(groups.size(), 1.0);
    if (method == Method::ols) return weights;
    for (int pass = 0; pass < 5; ++pass) {
      const Eigen::VectorXd x = solve(merged(groups, weights));
      for (int j = 0; j < n_; ++j) {
        const TriangularFactor& factor = groups[at(j)].factor;
        const double misfit = (factor.R() * x - factor.z()).squaredNorm() + factor.residual();
        weights[at(j)] = 1.0 / std::sqrt(std::max(misfit / double(rows_in(row_weights, j)), 1e-16));
      }
    }
    return weights;
  }

  /// Huber's weights on top of `fit`, iterated; the factors of the groups then hold weighted rows.
  void reweight(Fit& fit, const RowWeights& row_weights) const {
    for (int pass = 0; pass < 10; ++pass) {
      const std::vector<Eigen::MatrixXd> e = residuals(fit, rows_);
      RowWeights robust = row_weights;
      for (int j = 0; j < n_; ++j) {
        std::vector<double> size;
        for (std::size_t l = 0; l < e.size(); ++l)
          for (Eigen::Index i = 0; i < e[l].rows(); ++i)
            if (row_weights[l](i, j) != 0.0) size.push_back(std::abs(e[l](i, j)));
        const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2);
        std::nth_element(size.begin(), middle, size.end());
        const double limit = 1.345 * 1.4826 * *middle;
        for (std::size_t l = 0; l < e.size(); ++l)
          for (Eigen::Index i = 0; i < e[l].rows(); ++i)
            if (std::abs(e[l](i, j)) > limit) robust[l](i, j) *= std::sqrt(limit / std::abs(e[l](i, j)));
      }
      fit.groups = groups(robust);
      fit.weights = joint_weights(fit.groups, Method::wls, robust);
      fit.x = solve(merged(fit.groups, fit.weights));
    }
  }

  /// Variance of each joint's residual, and its correlation from row to row.
  void set_noise(Fit& fit, const RowWeights& weights) const {
    const std::vector<Eigen::MatrixXd> e = residuals(fit, rows_);
    fit.noise.resize(n_);
    fit.correlation.resize(n_);
    for (int j = 0; j < n_; ++j) {
      std::vector<Eigen::VectorXd> parts;
      double sum = 0.0;
      for (std::size_t l = 0; l < rows_.size(); ++l) {
        for (std::size_t p = 0; p + 1 < rows_[l].parts().size(); ++p) {
          std::vector<double> x;
          for (Eigen::Index i = rows_[l].parts()[p]; i < rows_[l].parts()[p + 1]; ++i)
            if (weights[l](i, j) != 0.0) x.push_back(e[l](i, j));
          parts.emplace_back(Eigen::Map<Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())));
          sum += parts.back().squaredNorm();
        }
      }
      const double free = std::max(1.0, double(rows_in(weights, j)) - double(columns_) / n_);
      RowGroup& group = fit.groups[at(j)];
      group.variance = sum / free;
      group.correlation = integrated_autocorrelation(parts);
      fit.noise[j] = std::sqrt(group.variance);
      fit.correlation[j] = group.correlation;
    }
  }

  /// Backward elimination. The letter's rule comes with the letter's statistic, which takes every sample for
  /// an independent one; its 30 % are several times as much once correlation is honoured. So a coefficient
  /// goes only if, on the honest scale too, dropping it saves more than it costs: |x| < sqrt(2) sigma,
  /// Akaike's price.
  void prune(Fit& fit, const RowWeights& weights) const {
    const double per_sample = double(rows_in(weights, 0)) / double(samples_);
    fit.kept.resize(at(columns_));
    std::iota(fit.kept.begin(), fit.kept.end(), 0);
    while (true) {
      std::vector<RowGroup> part = fit.groups;
      for (RowGroup& group : part) group.factor = group.factor.restricted(fit.kept);
      const Eigen::VectorXd x = solve(merged(part, fit.weights));
      fit.covariance = dynid::covariance(part, fit.weights);
      for (RowGroup& group : part) group.correlation = 1.0;
      const Eigen::VectorXd textbook = per_sample * dynid::covariance(part, fit.weights).diagonal();
      Eigen::Index worst = -1;
      double most = 0.0;
      for (Eigen::Index k = 0; k < x.size() && options_.prune_percent > 0.0; ++k) {
        const double percent = 100.0 * std::sqrt(textbook[k]) / std::abs(x[k]);
        if (percent <= options_.prune_percent || x[k] * x[k] >= 2.0 * fit.covariance(k, k) || percent <= most)
          continue;
        most = percent;
        worst = k;
      }
      if (worst < 0) {
        fit.x = Eigen::VectorXd::Zero(columns_);
        fit.x(fit.kept) = x;
        return;
      }
      fit.kept.erase(fit.kept.begin() + worst);
    }
  }

  const BaseParameters& base_;
  std::vector<RegressionRows> rows_;
  const IdentifyOptions& options_;
  Eigen::Index samples_;  // of all logs
  int n_, own_, columns_;
};

/// The fit, with eq. (25) on the joints where held-out blocks prefer it.
Fit fit_with_choice(const Problem& problem, const RowWeights& weights, const IdentifyOptions& options,
                    int joints, std::vector<FrictionComparison>* report) {
  Fit fit = problem.fit(weights);
  if (options.friction != FrictionLaw::sigmoid) return fit;
  constexpr int folds = 5;
  constexpr double worth_it = 0.98;  // two more parameters must earn two per cent of the held-out error
  Eigen::VectorXd linear = Eigen::VectorXd::Zero(joints), sigmoid = linear;
  double count = 0.0;
  for (int fold = 0; fold < folds; ++fold) {
    const auto out = [fold](int block) { return block == fold; };
    const RowWeights inside = problem.without(weights, folds, out),
                     outside = problem.only(weights, folds, out);
    Fit part = problem.fit(inside);
    const FitQuality a = problem.quality(part, problem.rows(), outside, "");
    for (int j = 0; j < joints; ++j)
      part.sigmoid[static_cast<std::size_t>(j)] = problem.fit_sigmoid(part, inside, j);
    const FitQuality b = problem.quality(part, problem.rows(), outside, "");
    linear += double(a.rows) * a.rmse.cwiseAbs2();
    sigmoid += double(b.rows) * b.rmse.cwiseAbs2();
    count += double(a.rows);
    if (options.progress) options.progress("choosing the friction laws", double(fold + 1) / folds);
  }
  for (int j = 0; j < joints; ++j) {
    const bool better = sigmoid[j] < worth_it * worth_it * linear[j];
    if (better) fit.sigmoid[static_cast<std::size_t>(j)] = problem.fit_sigmoid(fit, weights, j);
    if (report)
      report->push_back({j + 1, std::sqrt(linear[j] / count), std::sqrt(sigmoid[j] / count),
                         better ? FrictionLaw::sigmoid : FrictionLaw::linear});
  }
  return fit;
}

std::vector<RegressionRows> rows_of(const Robot& robot, const BaseParameters& base,
                                    const std::vector<Log>& logs, const IdentifyOptions& options,
                                    double& cutoff, std::vector<PreparedLog>& reports) {
  std::vector<RegressionRows> rows;
  PrepareOptions prepare_options = options.prepare;
  if (cutoff == 0.0) {
    cutoff = options.prepare.cutoff;
    if (cutoff == 0.0)
      for (const Log& log : logs) {  // one filter for all: the narrowest band that a log asks for
        const double own = choose_cutoff(log);
        cutoff = cutoff == 0.0 ? own : std::min(cutoff, own);
      }
  }
  prepare_options.cutoff = cutoff;
  for (const Log& log : logs) {
    if (log.joints() != robot.size())
      throw Error(log.source + ": the log has " + std::to_string(log.joints()) + " joints, the robot has " +
                  std::to_string(robot.size()));
    if (options.progress)
      options.progress("filtering " + log.source, double(rows.size()) / double(logs.size()));
    PreparedLog prepared = prepare(log, prepare_options);
    if (options.progress)
      options.progress("building the regressor", double(rows.size()) / double(logs.size()));
    rows.emplace_back(robot, base, prepared);
    prepared.segments.clear();
    reports.push_back(std::move(prepared));
    if (options.progress)
      options.progress("building the regressor", double(rows.size()) / double(logs.size()));
  }
  return rows;
}

}  // namespace

Identification identify(const Robot& robot, const std::vector<Log>& logs, const std::vector<Log>& validation,
                        const IdentifyOptions& options) {
  if (logs.empty()) throw Error("identification: no log was given");
  Identification out;
  out.base = base_parameters(robot, options.rotor_inertia);
  std::vector<RegressionRows> rows = rows_of(robot, out.base, logs, options, out.cutoff, out.logs);
  const int n = robot.size(), r = out.base.size();
  Eigen::Index samples = 0;
  for (const PreparedLog& log : out.logs) samples += log.report.samples;
  const Problem problem(out.base, std::move(rows), samples, options);
  const RowWeights everything = problem.all_rows();
  if (options.progress) options.progress("fitting", 0.0);
  Fit fit;
  try {
    fit = fit_with_choice(problem, everything, options, n, &out.friction);
  } catch (const Error& error) {
    throw Error(logs.front().source + ": " + error.what());
  }
  out.condition_number = condition_number(fit.unweighted);
  out.factor = fit.unweighted;
  out.fit = problem.quality(fit, problem.rows(), everything, "fit");

  if (!validation.empty()) {
    const std::vector<RegressionRows> held_out =
        rows_of(robot, out.base, validation, options, out.cutoff, out.logs);
    RowWeights ones;
    for (const RegressionRows& v : held_out) ones.emplace_back(Eigen::MatrixXd::Ones(v.size(), n));
    std::string source;
    for (const Log& log : validation) source += (source.empty() ? "" : ", ") + log.source;
    out.validation = problem.quality(fit, held_out, ones, source);
  } else if (options.validate) {
    const auto held_out = [](int block) { return block == 3 || block == 8; };
    const RowWeights inside = problem.without(everything, 10, held_out);
    try {
      const Fit second = fit_with_choice(problem, inside, options, n, nullptr);
      out.validation =
          problem.quality(second, problem.rows(), problem.only(everything, 10, held_out),
                          "a fifth of the logs (blocks 4 and 9 of ten), left out of a second fit");
    } catch (const Error& error) {
      out.validation_note = std::string("no part could be held out: ") + error.what();
    }
  }

  out.noise = fit.noise;
  out.correlation = fit.correlation;
  // A dropped coefficient is reported as it was before anything was dropped, and is zero in the model.
  const auto [unpruned, unpruned_covariance] = problem.unpruned(fit);
  const std::vector<std::string> names = problem.names();
  std::vector<double> values;
  std::vector<double> variances;
  const auto add = [&](const std::string& name, const std::string& expression, double value, double variance,
                       double reported, double reported_variance, bool kept) {
    values.push_back(value);
    variances.push_back(variance);
    out.coefficients.push_back({name, expression, reported,
                                100.0 * std::sqrt(reported_variance) / std::max(std::abs(reported), 1e-300),
                                kept});
  };
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(problem.columns(), problem.columns());
  covariance(fit.kept, fit.kept) = fit.covariance;
  for (int k = 0; k < problem.columns(); ++k) {
    const int j = k < r ? -1 : (k - r) / 3;
    if (j >= 0 && fit.sigmoid[static_cast<std::size_t>(j)]) continue;
    const bool kept = std::binary_search(fit.kept.begin(), fit.kept.end(), k);
    const std::string& name = names[static_cast<std::size_t>(k)];
    add(name, k < r ? out.base.expressions[static_cast<std::size_t>(k)] : name, fit.x[k], covariance(k, k),
        kept ? fit.x[k] : unpruned[k], kept ? covariance(k, k) : unpruned_covariance(k, k), kept);
  }
  for (int j = 0; j < n; ++j) {
    const auto& sigmoid = fit.sigmoid[static_cast<std::size_t>(j)];
    if (!sigmoid) continue;
    const JointFriction& f = sigmoid->friction;
    const double x[5] = {f.linear.viscous, f.linear.offset, f.sigmoid.phi1, f.sigmoid.phi2, f.sigmoid.phi3};
    const char* symbols[5] = {"fv", "fo", "phi1_", "phi2_", "phi3_"};
    for (int k = 0; k < 5; ++k)
      add(tag(symbols[k], j), tag(symbols[k], j), x[k], sigmoid->covariance(k, k), x[k],
          sigmoid->covariance(k, k), true);
  }
  out.rank = static_cast<int>(values.size());
  out.values = Eigen::Map<Eigen::VectorXd>(values.data(), out.rank);
  out.variance = Eigen::Map<Eigen::VectorXd>(variances.data(), out.rank);
  out.covariance = covariance.topLeftCorner(r, r);

  const Eigen::VectorXd pi =
      nearest_parameters(out.base, out.values.head(r), parameter_vector(robot, out.base));
  out.robot = robot;
  out.robot.set_parameters(pi.head(out.base.standard));
  for (int j = 0; j < n; ++j)
    out.robot.joints[static_cast<std::size_t>(j)].rotor_inertia =
        options.rotor_inertia ? pi[out.base.standard + j] : 0.0;
  for (int j = 0; j < n; ++j) {
    const auto& sigmoid = fit.sigmoid[static_cast<std::size_t>(j)];
    JointFriction f;
    if (sigmoid) {
      f = sigmoid->friction;
    } else if (options.friction != FrictionLaw::none) {
      const int first = problem.first(j);
      f.linear = {fit.x[first], fit.x[first + 1], fit.x[first + 2], options.velocity_scale};
    }
    out.robot.joints[static_cast<std::size_t>(j)].friction = f;
  }
  return out;
}

TwoStageFriction identify_friction(const Robot& robot, const std::vector<Log>& logs, FrictionLaw law,
                                   const IdentifyOptions& options) {
  if (logs.empty()) throw Error("friction identification: no log was given");
  const bool rotor = std::any_of(robot.joints.begin(), robot.joints.end(),
                                 [](const Joint& joint) { return joint.rotor_inertia != 0.0; });
  const BaseParameters base = base_parameters(robot, rotor);
  const Eigen::VectorXd x = base.K * parameter_vector(robot, base);
  double cutoff = 0.0;
  std::vector<PreparedLog> reports;
  const std::vector<RegressionRows> rows = rows_of(robot, base, logs, options, cutoff, reports);
  const int n = robot.size();

  TwoStageFriction out;
  out.robot = robot;
  out.before.rmse = out.after.rmse = Eigen::VectorXd::Zero(n);
  Eigen::Index total = 0;
  double energy = 0.0;
  for (const RegressionRows& r : rows) {
    total += r.size();
    energy += r.tau().squaredNorm();
  }
  for (int j = 0; j < n; ++j) {
    Eigen::VectorXd dq(total), difference(total);
    Eigen::Index first = 0;
    for (const RegressionRows& r : rows) {
      dq.segment(first, r.size()) = r.velocity(j);
      difference.segment(first, r.size()) = r.tau().col(j) - r.rigid(j) * x;
      first += r.size();
    }
    const FrictionChoice choice = choose_friction_law(dq, difference, options.velocity_scale);
    out.comparison.push_back({j + 1, choice.linear, choice.sigmoid, choice.law});
    JointFriction f;
    if (law == FrictionLaw::linear) f = fit_linear_friction(dq, difference, options.velocity_scale).friction;
    if (law == FrictionLaw::sigmoid) f = fit_sigmoid_friction(dq, difference).friction;
    out.robot.joints[static_cast<std::size_t>(j)].friction = f;
    out.before.rmse[j] = difference.norm();
    for (Eigen::Index i = 0; i < total; ++i) difference[i] -= friction_torque(f, dq[i]);
    out.after.rmse[j] = difference.norm();
  }
  for (FitQuality* q : {&out.before, &out.after}) {
    q->rows = total;
    q->relative_error_percent = 100.0 * q->rmse.norm() / std::sqrt(energy);
    q->rmse /= std::sqrt(double(total));
  }
  out.before.source = "without friction";
  out.after.source = "with friction";
  return out;
}

}  // namespace dynid
