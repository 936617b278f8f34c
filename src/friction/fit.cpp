// SPDX-License-Identifier: Apache-2.0
#include "dynid/friction/fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Parameter = detail::FrictionModel::Parameter;

constexpr Index most_bins = 400;          // enough for the scan of laws that are smooth in the velocity
constexpr std::size_t cells_refined = 6;  // the best cell of the grid need not lie in the deepest valley

std::size_t at(Index k) { return static_cast<std::size_t>(k); }

void check(const FrictionSamples& s) {
  if (s.dq.size() != s.difference.size())
    throw Error("friction fit: " + std::to_string(s.dq.size()) + " velocities for " +
                std::to_string(s.difference.size()) + " torques");
  if (s.weight.size() != 0 && s.weight.size() != s.dq.size())
    throw Error("friction fit: " + std::to_string(s.weight.size()) + " weights for " +
                std::to_string(s.dq.size()) + " samples");
  if (s.dq.size() < 3)
    throw Error("friction fit: " + std::to_string(s.dq.size()) + " samples, at least 3 are needed");
  if (!s.dq.allFinite() || !s.difference.allFinite() || !s.weight.allFinite())
    throw Error("friction fit: a sample is not finite");
}

/// Samples of like velocity put together, each with the sum of their weights.
FrictionSamples gathered(const FrictionSamples& s) {
  std::vector<Index> order;
  for (Index i = 0; i < s.dq.size(); ++i)
    if (s.weight.size() == 0 || s.weight[i] != 0.0) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return s.dq[a] < s.dq[b]; });
  const auto size = static_cast<Index>(order.size());
  const Index count = std::min(most_bins, size);
  FrictionSamples bins{VectorXd::Zero(count), VectorXd::Zero(count), VectorXd::Zero(count), {}};
  for (Index i = 0; i < size; ++i) {
    const Index k = i * count / size, from = order[at(i)];
    const double w = s.weight.size() == 0 ? 1.0 : s.weight[from] * s.weight[from];
    bins.dq[k] += w * s.dq[from];
    bins.difference[k] += w * s.difference[from];
    bins.weight[k] += w;
  }
  bins.dq.array() /= bins.weight.array();
  bins.difference.array() /= bins.weight.array();
  bins.weight = bins.weight.cwiseSqrt();
  return bins;
}

class Fit {
 public:
  Fit(const FrictionSamples& samples, detail::FrictionModel& model,
      const std::vector<FrictionUnknown>& unknowns)
      : samples_(samples), model_(model), all_(model.values()), unknowns_(unknowns) {
    for (const FrictionUnknown& unknown : unknowns) {
      const std::vector<Parameter>& known = model.parameters();
      const auto found =
          std::find_if(known.begin(), known.end(), [&](const Parameter& p) { return p.key == unknown.key; });
      if (found == known.end()) throw Error("friction fit: no law has a parameter '" + unknown.key + "'");
      const auto which = static_cast<Index>(found - known.begin());
      const auto k = static_cast<Index>(which_.size());
      which_.push_back(which);
      (found->role == FrictionRole::linear ? linear_ : nonlinear_).push_back(k);
    }
    const VectorXd speeds =
        samples.weight.size() == 0
            ? VectorXd(samples.dq.cwiseAbs())
            : VectorXd((samples.weight.array() != 0.0).select(samples.dq.cwiseAbs(), 0.0));
    fastest_ = std::max(speeds.maxCoeff(), 1e-9);
  }

  detail::FrictionEstimate run() {
    Point best = nonlinear_.empty() ? solved() : searched();
    set(best.x);
    return {best.J.transpose() * best.J, best.cost, evaluations_};
  }

 private:
  /// Values of the unknowns, what is left there and its derivatives with respect to them, weighted.
  struct Point {
    VectorXd x, left;
    MatrixXd J;
    double cost = 0.0;
  };

  void set(const VectorXd& x) {
    for (std::size_t k = 0; k < which_.size(); ++k) all_[which_[k]] = x[static_cast<Index>(k)];
    model_.set(all_);
  }

  Point point(const FrictionSamples& s, const VectorXd& x) {
    set(x);
    const auto columns = static_cast<Index>(1 + model_.parameters().size());
    MatrixXd rows(s.dq.size(), columns);
    Eigen::RowVectorXd row(columns);
    if (s.filtered) {
      rows = s.filtered(static_cast<int>(columns), [&](double dq) {
        model_.row(dq, row.data());
        return row;
      });
    } else {
      for (Index i = 0; i < s.dq.size(); ++i) {
        model_.row(s.dq[i], row.data());
        rows.row(i) = row;
      }
    }
    Point out;
    out.x = x;
    out.left = s.difference - rows.col(0);
    out.J.resize(rows.rows(), x.size());
    for (Index k = 0; k < x.size(); ++k) out.J.col(k) = rows.col(1 + which_[at(k)]);
    if (s.weight.size() != 0) {
      out.left.array() *= s.weight.array();
      out.J.array().colwise() *= s.weight.array();
    }
    out.cost = out.left.squaredNorm();
    return out;
  }

  /// Linear parameters alone.
  Point solved() {
    const Point zero = point(samples_, VectorXd::Zero(static_cast<Index>(which_.size())));
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(zero.J);
    if (qr.rank() < zero.J.cols()) {
      std::vector<std::string> keys;
      for (const FrictionUnknown& unknown : unknowns_) keys.push_back(unknown.key);
      throw Error("friction fit: these velocities do not tell " + list_in_words(keys) + " apart");
    }
    ++evaluations_;
    return point(samples_, qr.solve(zero.left));
  }

  /// The values of a nonlinear unknown that the scan tries.
  std::vector<double> tried(Index k) const {
    const Parameter& p = model_.parameters()[at(which_[at(k)])];
    const double scale = std::pow(fastest_, p.speed_power);
    const double least = std::max(p.least * scale, unknowns_[at(k)].least);
    const double most = std::max(least, std::min(p.most * scale, unknowns_[at(k)].most));
    std::vector<double> values;
    for (int i = 0; i < p.count; ++i) {
      const double part = double(i) / std::max(p.count - 1, 1);
      if (p.spacing == FrictionSpacing::geometric) {
        values.push_back(least * std::pow(most / least, part));
      } else {
        const double u = 2.0 * part - 1.0;
        values.push_back(std::clamp(u * std::abs(u) * (u < 0.0 ? -least : most), least, most));
      }
    }
    return values;
  }

  /// No friction: where a search begins that finds nothing.
  VectorXd none() const {
    VectorXd x = VectorXd::Zero(static_cast<Index>(which_.size()));
    for (const Index k : nonlinear_) {
      const Parameter& p = model_.parameters()[at(which_[at(k)])];
      if (p.spacing == FrictionSpacing::geometric) x[k] = std::pow(fastest_, p.speed_power);
    }
    return limited(x);
  }

  VectorXd limited(VectorXd x) const {
    for (const Index k : nonlinear_) x[k] = std::clamp(x[k], unknowns_[at(k)].least, unknowns_[at(k)].most);
    return x;
  }

  struct Cell {
    double left;
    VectorXd x;
  };

  /// Every cell of the grid over the nonlinear unknowns, the linear ones solved for.
  std::vector<Cell> scanned(const FrictionSamples& bins) {
    std::vector<std::vector<double>> values;
    for (const Index k : nonlinear_) values.push_back(tried(k));
    std::vector<Cell> cells;
    std::vector<std::size_t> digit(nonlinear_.size(), 0);
    for (bool more = true; more;) {
      VectorXd x = VectorXd::Zero(static_cast<Index>(which_.size()));
      // A law's derivatives with respect to its linear parameters do not depend on them.
      for (std::size_t d = 0; d < digit.size(); ++d) x[nonlinear_[d]] = values[d][digit[d]];
      const Point p = point(bins, x);
      ++evaluations_;
      double left = p.cost;
      if (!linear_.empty()) {
        const MatrixXd A = p.J(Eigen::all, linear_);
        const VectorXd b = A.colPivHouseholderQr().solve(p.left);
        left = (p.left - A * b).squaredNorm();
        for (std::size_t l = 0; l < linear_.size(); ++l) x[linear_[l]] = b[static_cast<Index>(l)];
      }
      if (std::isfinite(left) && x.allFinite()) cells.push_back({left, x});
      more = false;
      for (std::size_t d = digit.size(); d-- > 0 && !more;) {
        more = ++digit[d] < values[d].size();
        if (!more) digit[d] = 0;
      }
    }
    return cells;
  }

  Point searched() {
    const FrictionSamples bins = gathered(samples_);
    std::vector<Cell> cells = scanned(bins);
    const std::size_t best = std::min(cells_refined, cells.size());
    std::partial_sort(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(best), cells.end(),
                      [](const Cell& a, const Cell& b) { return a.left < b.left; });
    Point lowest = point(samples_, none());
    if (samples_.filtered) {  // which is dear: the valley is found without the filter
      Point valley;
      for (std::size_t k = 0; k < best; ++k) {
        Point trial = refined(bins, limited(cells[k].x));
        if (k == 0 || trial.cost < valley.cost) valley = std::move(trial);
      }
      cells[0].x = valley.x;
    }
    const std::size_t starts = samples_.filtered ? 1 : best;
    for (std::size_t k = 0; k < starts; ++k) {
      Point trial = refined(samples_, limited(cells[k].x));
      if (trial.cost < lowest.cost) lowest = std::move(trial);
    }
    return lowest;
  }

  /// Levenberg-Marquardt.
  Point refined(const FrictionSamples& samples, const VectorXd& start) {
    Point now = point(samples, start);
    ++evaluations_;
    double damping = 1e-3;
    int rejected = 0;
    for (int iteration = 0; iteration < 200 && rejected < 12; ++iteration) {
      const MatrixXd JtJ = now.J.transpose() * now.J;
      const VectorXd Jte = now.J.transpose() * now.left;
      bool accepted = false;
      for (; rejected < 12; ++rejected) {
        MatrixXd H = JtJ;
        H.diagonal() += damping * (JtJ.diagonal().array() + 1e-12 * JtJ.diagonal().maxCoeff()).matrix();
        const VectorXd step = H.ldlt().solve(Jte);
        if (step.allFinite()) {
          Point trial = point(samples, limited(now.x + step));
          ++evaluations_;
          if (trial.cost < now.cost) {
            accepted = (now.cost - trial.cost) / now.cost > 1e-13;
            now = std::move(trial);
            damping = std::max(0.2 * damping, 1e-12);
            rejected = 0;
            break;
          }
        }
        damping *= 5.0;
      }
      if (!accepted) break;
    }
    return now;
  }

  const FrictionSamples& samples_;
  detail::FrictionModel& model_;
  VectorXd all_;  // parameters, those that are no unknowns as given
  const std::vector<FrictionUnknown>& unknowns_;
  std::vector<Index> which_;               // parameter that each unknown is
  std::vector<Index> linear_, nonlinear_;  // unknowns
  double fastest_ = 0.0;
  int evaluations_ = 0;
};

double sum_squares(const JointFriction& f, const VectorXd& dq, const VectorXd& difference) {
  double sum = 0.0;
  for (Index i = 0; i < dq.size(); ++i) {
    const double e = difference[i] - friction_torque(f, dq[i]);
    sum += e * e;
  }
  return sum;
}

/// The rows of blocks other than `fold` (kept) or of that block alone.
VectorXd rows_of(const VectorXd& x, int fold, int folds, bool held_out) {
  std::vector<double> out;
  for (Index i = 0; i < x.size(); ++i)
    if ((i * folds / x.size() == fold) == held_out) out.push_back(x[i]);
  return Eigen::Map<VectorXd>(out.data(), static_cast<Index>(out.size()));
}

}  // namespace

detail::FrictionEstimate detail::fit_friction(const FrictionSamples& samples, FrictionModel& model,
                                              const std::vector<FrictionUnknown>& unknowns) {
  check(samples);
  if (unknowns.empty()) throw Error("friction fit: there is no unknown");
  return Fit(samples, model, unknowns).run();
}

FrictionFit fit_linear_friction(const VectorXd& dq, const VectorXd& difference, double velocity_scale) {
  JointFriction given;
  given.linear.velocity_scale = velocity_scale;
  return fit_friction({dq, difference, {}, {}}, given, unknowns_of<LinearFriction>());
}

FrictionFit fit_sigmoid_friction(const VectorXd& dq, const VectorXd& difference) {
  return fit_friction({dq, difference, {}, {}}, JointFriction{}, unknowns_of<SigmoidFriction>());
}

FrictionChoice choose_friction_law(const VectorXd& dq, const VectorXd& difference, double velocity_scale,
                                   int folds) {
  check({dq, difference, {}, {}});
  if (folds < 2 || dq.size() < 4 * folds)
    throw Error("friction fit: " + std::to_string(dq.size()) + " samples are too few for " +
                std::to_string(folds) + " held-out blocks");
  FrictionChoice choice;
  for (int fold = 0; fold < folds; ++fold) {
    const VectorXd v = rows_of(dq, fold, folds, false), d = rows_of(difference, fold, folds, false);
    const VectorXd v_out = rows_of(dq, fold, folds, true), d_out = rows_of(difference, fold, folds, true);
    choice.none += d_out.squaredNorm();
    choice.linear += sum_squares(fit_linear_friction(v, d, velocity_scale).friction, v_out, d_out);
    choice.sigmoid += sum_squares(fit_sigmoid_friction(v, d).friction, v_out, d_out);
  }
  for (double* e : {&choice.none, &choice.linear, &choice.sigmoid}) *e = std::sqrt(*e / double(dq.size()));
  if (choice.none <= choice.linear && choice.none <= choice.sigmoid) {
    choice.law = FrictionLaw::none;
    choice.fit.sum_squares = difference.squaredNorm();
  } else if (choice.linear <= choice.sigmoid) {
    choice.law = FrictionLaw::linear;
    choice.fit = fit_linear_friction(dq, difference, velocity_scale);
  } else {
    choice.law = FrictionLaw::sigmoid;
    choice.fit = fit_sigmoid_friction(dq, difference);
  }
  return choice;
}

}  // namespace dynid
