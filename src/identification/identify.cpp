// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/identify.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "dynid/error.hpp"
#include "dynid/friction/fit.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/identification/regression.hpp"

namespace dynid {
namespace {

std::string tag(const char* symbol, int joint) { return symbol + std::to_string(joint + 1); }

/// Which law each joint has; for a sigmoid joint, the current phi (phi1 scales the derivatives).
struct Laws {
  std::vector<FrictionLaw> law;
  std::vector<SigmoidFriction> phi;
};

/// Columns of the whole problem: rigid body first, then friction joint by joint.
struct Layout {
  int rigid = 0;
  int columns = 0;
  std::vector<int> first, count;  // of each joint's friction columns
};

int friction_columns(FrictionLaw law, bool with_phi) {
  switch (law) {
    case FrictionLaw::none:
      return 0;
    case FrictionLaw::linear:
      return 3;
    case FrictionLaw::sigmoid:
      return with_phi ? 5 : 3;
  }
  return 0;
}

Layout layout_of(const Laws& laws, int rigid, bool with_phi) {
  Layout layout;
  layout.rigid = layout.columns = rigid;
  for (FrictionLaw law : laws.law) {
    layout.first.push_back(layout.columns);
    layout.count.push_back(friction_columns(law, with_phi));
    layout.columns += layout.count.back();
  }
  return layout;
}

/// Square roots of row weights, N x n, one a log; 0 leaves a row out.
using RowWeights = std::vector<Eigen::MatrixXd>;

struct Fit {
  Laws laws;
  Layout layout;
  std::vector<RowGroup> groups;  // one a joint
  std::vector<double> weights;   // one a joint
  TriangularFactor unweighted;
  Eigen::VectorXd x;
  std::vector<int> kept;
  Eigen::MatrixXd covariance;  // of the kept
};

class Problem {
 public:
  Problem(const BaseParameters& base, std::vector<RegressionRows> rows, const IdentifyOptions& options)
      : base_(base), rows_(std::move(rows)), options_(options), n_(rows_.front().joints()) {}

  const std::vector<RegressionRows>& rows() const { return rows_; }

  RowWeights all_rows() const {
    RowWeights weights;
    for (const RegressionRows& r : rows_) weights.emplace_back(Eigen::MatrixXd::Ones(r.size(), n_));
    return weights;
  }

  /// Leaves out the rows of block `fold` of `folds` of every log (chosen by `out`), with a margin where filters overlap.
  RowWeights without(int folds, const std::function<bool(int)>& out) const {
    RowWeights weights = all_rows();
    for (std::size_t l = 0; l < rows_.size(); ++l) {
      const Eigen::Index size = rows_[l].size(), margin = rows_[l].overlap();
      for (Eigen::Index i = 0; i < size; ++i) {
        const Eigen::Index before = std::max<Eigen::Index>(0, i - margin), after = std::min(size - 1, i + margin);
        for (Eigen::Index k : {before, i, after})
          if (out(static_cast<int>(k * folds / size))) weights[l].row(i).setZero();
      }
    }
    return weights;
  }

  /// Only the rows of the blocks chosen by `out`.
  RowWeights only(int folds, const std::function<bool(int)>& out) const {
    RowWeights weights = all_rows();
    for (std::size_t l = 0; l < rows_.size(); ++l)
      for (Eigen::Index i = 0; i < rows_[l].size(); ++i)
        if (!out(static_cast<int>(i * folds / rows_[l].size()))) weights[l].row(i).setZero();
    return weights;
  }

  std::vector<std::string> names(const Laws& laws, bool with_phi) const {
    std::vector<std::string> names = base_.names;
    for (int j = 0; j < n_; ++j) {
      const FrictionLaw law = laws.law[at(j)];
      if (law == FrictionLaw::linear)
        for (const char* symbol : {"fv", "fc", "fo"}) names.push_back(tag(symbol, j));
      if (law == FrictionLaw::sigmoid) {
        for (const char* symbol : {"fv", "fo", "phi1_"}) names.push_back(tag(symbol, j));
        if (with_phi)
          for (const char* symbol : {"phi2_", "phi3_"}) names.push_back(tag(symbol, j));
      }
    }
    return names;
  }

  Fit fit(const RowWeights& weights) const {
    Fit best = linear_fit(uniform_laws(options_.friction == FrictionLaw::sigmoid ? FrictionLaw::linear
                                                                                 : options_.friction),
                          weights, options_.method);
    return best;
  }

  /// The sigmoid law where `joints` says so, eq. (24) elsewhere.
  Fit sigmoid_fit(const Fit& start, const std::vector<bool>& joints, const RowWeights& weights) const {
    Laws laws = start.laws;
    const std::vector<Eigen::MatrixXd> residual = residuals(start, rows_);
    for (int j = 0; j < n_; ++j) {
      if (!joints[at(j)]) continue;
      laws.law[at(j)] = FrictionLaw::sigmoid;
      laws.phi[at(j)] = scan(start, residual, weights, j);
    }
    return improve(laws, start.weights, weights);
  }

  /// Rows predicted minus rows measured, N x n, one a log.
  std::vector<Eigen::MatrixXd> residuals(const Fit& fit, const std::vector<RegressionRows>& rows) const {
    std::vector<Eigen::MatrixXd> out;
    const Layout layout = layout_of(fit.laws, base_.size(), true);
    for (const RegressionRows& r : rows) {
      Eigen::MatrixXd e(r.size(), n_);
      for (int j = 0; j < n_; ++j) {
        e.col(j) = r.rigid(j) * fit.x.head(base_.size()) - r.tau().col(j);
        if (layout.count[at(j)] > 0)
          e.col(j) += friction_block(r, fit.laws, j, true) * fit.x.segment(layout.first[at(j)], layout.count[at(j)]);
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

  /// Noise of each joint, correlation, and backward elimination of what the data do not determine.
  void finish(Fit& fit, const RowWeights& weights) const {
    const std::vector<Eigen::MatrixXd> e = residuals(fit, rows_);
    for (int j = 0; j < n_; ++j) {
      std::vector<Eigen::VectorXd> parts;
      double sum = 0.0;
      Eigen::Index count = 0;
      for (std::size_t l = 0; l < rows_.size(); ++l) {
        for (std::size_t p = 0; p + 1 < rows_[l].parts().size(); ++p) {
          std::vector<double> x;
          for (Eigen::Index i = rows_[l].parts()[p]; i < rows_[l].parts()[p + 1]; ++i)
            if (weights[l](i, j) != 0.0) x.push_back(e[l](i, j));
          parts.emplace_back(Eigen::Map<Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())));
          sum += parts.back().squaredNorm();
          count += parts.back().size();
        }
      }
      RowGroup& group = fit.groups[at(j)];
      const double free = std::max(1.0, double(count) - double(fit.layout.columns) / n_);
      group.variance = sum / free;
      group.correlation = integrated_autocorrelation(parts);
    }
    fit.kept.resize(at(fit.layout.columns));
    std::iota(fit.kept.begin(), fit.kept.end(), 0);
    while (true) {
      std::vector<RowGroup> groups = fit.groups;
      TriangularFactor merged(static_cast<int>(fit.kept.size()));
      for (std::size_t g = 0; g < groups.size(); ++g) {
        groups[g].factor = groups[g].factor.restricted(fit.kept);
        merged.merge(groups[g].factor, fit.weights[g]);
      }
      const Eigen::VectorXd x = solve(merged);
      fit.covariance = covariance(groups, fit.weights);
      int worst = -1;
      double most = options_.prune_percent;
      for (int k = 0; k < x.size() && options_.prune_percent > 0.0; ++k) {
        if (!prunable(fit, fit.kept[at(k)])) continue;
        const double percent = 100.0 * std::sqrt(fit.covariance(k, k)) / std::abs(x[k]);
        if (percent > most) {
          most = percent;
          worst = k;
        }
      }
      if (worst < 0) {
        set_solution(fit, x);
        return;
      }
      fit.kept.erase(fit.kept.begin() + worst);
    }
  }

 private:
  static std::size_t at(int k) { return static_cast<std::size_t>(k); }

  Laws uniform_laws(FrictionLaw law) const {
    return {std::vector<FrictionLaw>(at(n_), law), std::vector<SigmoidFriction>(at(n_))};
  }

  Eigen::MatrixXd friction_block(const RegressionRows& r, const Laws& laws, int j, bool with_phi) const {
    const FrictionLaw law = laws.law[at(j)];
    if (law == FrictionLaw::linear) {
      LinearFriction f;
      f.velocity_scale = options_.velocity_scale;
      return r.velocity_columns(j, 3, [&](double dq) { return Eigen::RowVectorXd(friction_regressor(f, dq)); });
    }
    const SigmoidFriction phi = laws.phi[at(j)];
    return r.velocity_columns(j, with_phi ? 5 : 3, [&](double dq) {
      Eigen::RowVectorXd row(with_phi ? 5 : 3);
      const Eigen::RowVector3d d = friction_regressor(phi, dq);
      row[0] = dq;
      row[1] = 1.0;
      row[2] = d[0];
      if (with_phi) row.tail<2>() = d.tail<2>();
      return row;
    });
  }

  /// One factor a joint, of all columns of the layout.
  std::vector<RowGroup> groups(const Laws& laws, const Layout& layout, const RowWeights& weights,
                               bool with_phi) const {
    std::vector<RowGroup> groups;
    for (int j = 0; j < n_; ++j) {
      const int own = layout.count[at(j)];
      TriangularFactor local(layout.rigid + own);
      for (std::size_t l = 0; l < rows_.size(); ++l) {
        const RegressionRows& r = rows_[l];
        Eigen::MatrixXd block(r.size(), layout.rigid + own + 1);
        block.leftCols(layout.rigid) = r.rigid(j);
        if (own > 0) block.middleCols(layout.rigid, own) = friction_block(r, laws, j, with_phi);
        block.rightCols<1>() = r.tau().col(j);
        block = weights[l].col(j).asDiagonal() * block;
        local.add(block);
      }
      std::vector<int> where(at(layout.rigid + own));
      std::iota(where.begin(), where.begin() + layout.rigid, 0);
      std::iota(where.begin() + layout.rigid, where.end(), layout.first[at(j)]);
      groups.push_back({local.scattered(where, layout.columns), 1.0, 1.0});
    }
    return groups;
  }

  static TriangularFactor merged(const std::vector<RowGroup>& groups, const std::vector<double>& weights) {
    TriangularFactor all(groups.front().factor.columns());
    for (std::size_t g = 0; g < groups.size(); ++g) all.merge(groups[g].factor, weights[g]);
    return all;
  }

  static double misfit(const RowGroup& group, const Eigen::VectorXd& x) {
    return (group.factor.R() * x - group.factor.z()).squaredNorm() + group.factor.residual();
  }

  /// Weights of method wls for given factors; ones for ols.
  std::vector<double> joint_weights(const std::vector<RowGroup>& groups, Method method,
                                    const RowWeights& row_weights) const {
    std::vector<double> weights(groups.size(), 1.0);
    if (method == Method::ols) return weights;
    for (int pass = 0; pass < 5; ++pass) {
      const Eigen::VectorXd x = solve(merged(groups, weights));
      for (int j = 0; j < n_; ++j) {
        double count = 0.0;
        for (const Eigen::MatrixXd& w : row_weights) count += double((w.col(j).array() != 0.0).count());
        weights[at(j)] = 1.0 / std::sqrt(std::max(misfit(groups[at(j)], x) / count, 1e-16));
      }
    }
    return weights;
  }

  Fit linear_fit(const Laws& laws, const RowWeights& row_weights, Method method) const {
    Fit fit;
    fit.laws = laws;
    fit.layout = layout_of(laws, base_.size(), true);
    fit.groups = groups(laws, fit.layout, row_weights, true);
    fit.unweighted = merged(fit.groups, std::vector<double>(fit.groups.size(), 1.0));
    check_excitation(fit.unweighted, names(laws, true));
    fit.weights = joint_weights(fit.groups, method, row_weights);
    fit.x = solve(merged(fit.groups, fit.weights));
    if (method == Method::irls) reweight(fit, row_weights);
    return fit;
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
      fit.groups = groups(fit.laws, fit.layout, robust, true);
      fit.weights = joint_weights(fit.groups, Method::wls, robust);
      fit.x = solve(merged(fit.groups, fit.weights));
    }
  }

  /// (phi2, phi3) from the differences that the start leaves on joint j, its own friction put back.
  SigmoidFriction scan(const Fit& start, const std::vector<Eigen::MatrixXd>& residual, const RowWeights& weights,
                       int j) const {
    std::vector<double> v, d;
    for (std::size_t l = 0; l < rows_.size(); ++l) {
      const Eigen::VectorXd dq = rows_[l].velocity(j);
      Eigen::VectorXd difference = -residual[l].col(j);
      const int own = start.layout.count[at(j)];
      // Only the step of eq. (24): what the viscous term and the offset explain stays with them.
      if (own > 0)
        difference += friction_block(rows_[l], start.laws, j, true).col(1) * start.x[start.layout.first[at(j)] + 1];
      for (Eigen::Index i = 0; i < dq.size(); ++i) {
        if (weights[l](i, j) == 0.0) continue;
        v.push_back(dq[i]);
        d.push_back(difference[i]);
      }
    }
    const FrictionFit fit =
        fit_sigmoid_friction(Eigen::Map<Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size())),
                             Eigen::Map<Eigen::VectorXd>(d.data(), static_cast<Eigen::Index>(d.size())));
    return clamped(fit.friction.sigmoid);
  }

  /// No sharper than the smoothed sign, no flatter than a line over any robot's velocities.
  SigmoidFriction clamped(SigmoidFriction phi) const {
    if (phi.phi2 < 0.0) phi = {-phi.phi1, -phi.phi2, phi.phi3};  // the same curve
    const double sharpest = 2.0 / std::max(options_.velocity_scale, 0.005);
    phi.phi2 = std::clamp(phi.phi2, 0.5, sharpest);
    phi.phi3 = std::clamp(phi.phi3, -1.0, 1.0);
    return phi;
  }

  struct Projected {
    double cost = 0.0;
    Eigen::VectorXd x;
  };

  /// All that is linear solved for, for given (phi2, phi3).
  Projected project(const Laws& laws, const std::vector<double>& weights, const RowWeights& row_weights) const {
    const TriangularFactor factor =
        merged(groups(laws, layout_of(laws, base_.size(), false), row_weights, false), weights);
    return {factor.residual(), solve(factor)};
  }

  /// phi1 into the laws, from the linear solution.
  void take_phi1(Laws& laws, const Eigen::VectorXd& x) const {
    const Layout layout = layout_of(laws, base_.size(), false);
    for (int j = 0; j < n_; ++j)
      if (laws.law[at(j)] == FrictionLaw::sigmoid) laws.phi[at(j)].phi1 = x[layout.first[at(j)] + 2];
  }

  /// Levenberg-Marquardt over all (phi2, phi3) at once; the linear unknowns follow (variable projection).
  Fit improve(Laws laws, const std::vector<double>& weights, const RowWeights& row_weights) const {
    Projected now = project(laws, weights, row_weights);
    take_phi1(laws, now.x);
    double damping = 1e-2;
    for (int iteration = 0; iteration < 40 && damping < 1e6; ++iteration) {
      const Layout layout = layout_of(laws, base_.size(), true);
      const TriangularFactor factor = merged(groups(laws, layout, row_weights, true), weights);
      Eigen::MatrixXd rows(0, layout.columns + 1);
      for (int j = 0; j < n_; ++j) {
        if (laws.law[at(j)] != FrictionLaw::sigmoid) continue;
        for (int k : {3, 4}) {
          const int column = layout.first[at(j)] + k;
          rows.conservativeResize(rows.rows() + 1, Eigen::NoChange);
          rows.bottomRows<1>().setZero();
          rows(rows.rows() - 1, column) = std::sqrt(damping) * (factor.R().col(column).norm() + 1e-9);
        }
      }
      TriangularFactor damped = factor;
      damped.add(rows);
      const Eigen::VectorXd x = solve(damped);
      Laws trial = laws;
      for (int j = 0; j < n_; ++j) {
        if (laws.law[at(j)] != FrictionLaw::sigmoid) continue;
        SigmoidFriction& phi = trial.phi[at(j)];
        phi.phi2 += x[layout.first[at(j)] + 3];
        phi.phi3 += x[layout.first[at(j)] + 4];
        phi = clamped(phi);
      }
      const Projected next = project(trial, weights, row_weights);
      if (next.cost < now.cost) {
        const double gain = (now.cost - next.cost) / now.cost;
        take_phi1(trial, next.x);
        laws = trial;
        now = next;
        damping = std::max(0.2 * damping, 1e-9);
        if (gain < 1e-8) break;
      } else {
        damping *= 6.0;
      }
    }
    Fit fit;
    fit.laws = laws;
    fit.layout = layout_of(laws, base_.size(), true);
    fit.groups = groups(laws, fit.layout, row_weights, true);
    fit.unweighted = merged(fit.groups, std::vector<double>(fit.groups.size(), 1.0));
    fit.weights = weights;
    fit.kept.resize(at(fit.layout.columns));
    std::iota(fit.kept.begin(), fit.kept.end(), 0);
    // The increments of (phi2, phi3) are zero here: what is left of them is the optimiser's tolerance.
    fit.x = Eigen::VectorXd::Zero(fit.layout.columns);
    const Layout narrow = layout_of(laws, base_.size(), false);
    fit.x.head(base_.size()) = now.x.head(base_.size());
    for (int j = 0; j < n_; ++j)
      fit.x.segment(fit.layout.first[at(j)], narrow.count[at(j)]) =
          now.x.segment(narrow.first[at(j)], narrow.count[at(j)]);
    return fit;
  }

  /// phi1 with its phi2 and phi3 stand or fall together.
  bool prunable(const Fit& fit, int column) const {
    for (int j = 0; j < n_; ++j)
      if (fit.laws.law[at(j)] == FrictionLaw::sigmoid && column >= fit.layout.first[at(j)] + 2 &&
          column < fit.layout.first[at(j)] + 5)
        return false;
    return true;
  }

  void set_solution(Fit& fit, const Eigen::VectorXd& kept) const {
    const Eigen::VectorXd before = fit.x;
    fit.x = Eigen::VectorXd::Zero(fit.layout.columns);
    for (std::size_t k = 0; k < fit.kept.size(); ++k) fit.x[fit.kept[k]] = kept[static_cast<Eigen::Index>(k)];
    for (int j = 0; j < n_; ++j)  // increments of (phi2, phi3) are not part of the solution
      if (fit.laws.law[at(j)] == FrictionLaw::sigmoid) fit.x.segment<2>(fit.layout.first[at(j)] + 3).setZero();
  }

  const BaseParameters& base_;
  std::vector<RegressionRows> rows_;
  const IdentifyOptions& options_;
  int n_;
};

/// A fit with the law that held-out blocks prefer on each joint.
Fit fit_with_choice(const Problem& problem, const RowWeights& weights, const IdentifyOptions& options, int joints,
                    std::vector<FrictionComparison>* report) {
  const Fit linear = problem.fit(weights);
  if (options.friction != FrictionLaw::sigmoid) return linear;
  constexpr int folds = 5;
  const auto n = static_cast<std::size_t>(joints);
  const std::vector<bool> everywhere(n, true);
  Eigen::VectorXd linear_error = Eigen::VectorXd::Zero(joints), sigmoid_error = linear_error;
  double count = 0.0;
  for (int fold = 0; fold < folds; ++fold) {
    const auto out = [fold](int block) { return block == fold; };
    RowWeights inside = problem.without(folds, out), outside = problem.only(folds, out);
    for (std::size_t l = 0; l < inside.size(); ++l) {
      inside[l].array() *= (weights[l].array() != 0.0).cast<double>();
      outside[l].array() *= (weights[l].array() != 0.0).cast<double>();
    }
    const Fit a = problem.fit(inside);
    const Fit b = problem.sigmoid_fit(a, everywhere, inside);
    const FitQuality qa = problem.quality(a, problem.rows(), outside, "");
    const FitQuality qb = problem.quality(b, problem.rows(), outside, "");
    linear_error += double(qa.rows) * qa.rmse.cwiseAbs2();
    sigmoid_error += double(qb.rows) * qb.rmse.cwiseAbs2();
    count += double(qa.rows);
    if (options.progress) options.progress("choosing the friction laws", double(fold + 1) / folds);
  }
  std::vector<bool> chosen(n, false);
  for (int j = 0; j < joints; ++j) {
    chosen[static_cast<std::size_t>(j)] = sigmoid_error[j] < linear_error[j];
    if (report)
      report->push_back({j + 1, std::sqrt(linear_error[j] / count), std::sqrt(sigmoid_error[j] / count),
                         chosen[static_cast<std::size_t>(j)] ? FrictionLaw::sigmoid : FrictionLaw::linear});
  }
  return problem.sigmoid_fit(linear, chosen, weights);
}

std::vector<RegressionRows> rows_of(const Robot& robot, const BaseParameters& base, const std::vector<Log>& logs,
                                    const IdentifyOptions& options, double& cutoff, std::vector<PreparedLog>& reports) {
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
    PreparedLog prepared = prepare(log, prepare_options);
    rows.emplace_back(robot, base, prepared);
    prepared.segments.clear();
    reports.push_back(std::move(prepared));
    if (options.progress) options.progress("building the regressor", double(rows.size()) / double(logs.size()));
  }
  return rows;
}

void put_friction(Robot& robot, const Fit& fit, double velocity_scale) {
  for (int j = 0; j < robot.size(); ++j) {
    JointFriction f;
    const auto k = static_cast<std::size_t>(j);
    const int first = fit.layout.first[k];
    if (fit.laws.law[k] == FrictionLaw::linear) {
      f.linear = {fit.x[first], fit.x[first + 1], fit.x[first + 2], velocity_scale};
    } else if (fit.laws.law[k] == FrictionLaw::sigmoid) {
      f.linear = {fit.x[first], 0.0, fit.x[first + 1], 0.0};
      f.sigmoid = {fit.x[first + 2], fit.laws.phi[k].phi2, fit.laws.phi[k].phi3};
    }
    robot.joints[k].friction = f;
  }
}

}  // namespace

Identification identify(const Robot& robot, const std::vector<Log>& logs, const std::vector<Log>& validation,
                        const IdentifyOptions& options) {
  if (logs.empty()) throw Error("identification: no log was given");
  Identification out;
  out.base = base_parameters(robot, options.rotor_inertia);
  std::vector<RegressionRows> rows = rows_of(robot, out.base, logs, options, out.cutoff, out.logs);
  const int n = robot.size(), r = out.base.size();
  const Problem problem(out.base, std::move(rows), options);
  const RowWeights everything = problem.all_rows();
  Fit fit;
  try {
    fit = fit_with_choice(problem, everything, options, n, &out.friction);
  } catch (const Error& error) {
    throw Error(logs.front().source + ": " + error.what());
  }
  out.rank = fit.layout.columns;
  out.condition_number = condition_number(fit.unweighted);
  out.factor = fit.unweighted;
  problem.finish(fit, everything);
  out.fit = problem.quality(fit, problem.rows(), everything, "fit");

  if (!validation.empty()) {
    const std::vector<RegressionRows> held_out =
        rows_of(robot, out.base, validation, options, out.cutoff, out.logs);
    RowWeights ones;
    for (const RegressionRows& v : held_out) ones.emplace_back(Eigen::MatrixXd::Ones(v.size(), n));
    std::string source;
    for (const Log& log : validation) source += (source.empty() ? "" : ", ") + log.source;
    out.validation = problem.quality(fit, held_out, ones, source);
  } else {
    const auto held_out = [](int block) { return block == 3 || block == 8; };
    const RowWeights inside = problem.without(10, held_out);
    try {
      Fit second = fit_with_choice(problem, inside, options, n, nullptr);
      problem.finish(second, inside);
      out.validation = problem.quality(second, problem.rows(), problem.only(10, held_out),
                                       "a fifth of the logs (blocks 4 and 9 of ten), left out of a second fit");
    } catch (const Error& error) {
      out.validation_note = std::string("no part could be held out: ") + error.what();
    }
  }

  out.values = fit.x;
  for (int j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (fit.laws.law[k] != FrictionLaw::sigmoid) continue;
    out.values[fit.layout.first[k] + 3] = fit.laws.phi[k].phi2;
    out.values[fit.layout.first[k] + 4] = fit.laws.phi[k].phi3;
  }
  out.covariance = Eigen::MatrixXd::Zero(out.rank, out.rank);
  out.covariance(fit.kept, fit.kept) = fit.covariance;
  out.noise.resize(n);
  out.correlation.resize(n);
  for (int j = 0; j < n; ++j) {
    out.noise[j] = std::sqrt(fit.groups[static_cast<std::size_t>(j)].variance);
    out.correlation[j] = fit.groups[static_cast<std::size_t>(j)].correlation;
  }
  // A dropped coefficient is reported as it was before anything was dropped, and is zero in the model.
  TriangularFactor full(out.rank);
  for (std::size_t g = 0; g < fit.groups.size(); ++g) full.merge(fit.groups[g].factor, fit.weights[g]);
  const Eigen::VectorXd unpruned = solve(full);
  const Eigen::MatrixXd unpruned_covariance = covariance(fit.groups, fit.weights);
  const std::vector<std::string> names = problem.names(fit.laws, true);
  for (int k = 0; k < out.rank; ++k) {
    const bool kept = std::binary_search(fit.kept.begin(), fit.kept.end(), k);
    const double value = kept ? out.values[k] : unpruned[k];
    const double variance = kept ? out.covariance(k, k) : unpruned_covariance(k, k);
    const std::string& name = names[static_cast<std::size_t>(k)];
    out.coefficients.push_back({name, k < r ? out.base.expressions[static_cast<std::size_t>(k)] : name, value,
                                100.0 * std::sqrt(variance) / std::max(std::abs(value), 1e-300), kept});
  }

  const Eigen::VectorXd pi =
      nearest_parameters(out.base, out.values.head(r), parameter_vector(robot, out.base));
  out.robot = robot;
  out.robot.set_parameters(pi.head(out.base.standard));
  for (int j = 0; j < n; ++j)
    out.robot.joints[static_cast<std::size_t>(j)].rotor_inertia =
        options.rotor_inertia ? pi[out.base.standard + j] : 0.0;
  put_friction(out.robot, fit, options.velocity_scale);
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
