// SPDX-License-Identifier: Apache-2.0
#include "dynid/friction/fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlopt.hpp>
#include <string>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {
namespace {

void check(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference) {
  if (dq.size() != difference.size())
    throw Error("friction fit: " + std::to_string(dq.size()) + " velocities for " +
                std::to_string(difference.size()) + " torques");
  if (dq.size() < 3)
    throw Error("friction fit: " + std::to_string(dq.size()) + " samples, at least 3 are needed");
  if (!dq.allFinite() || !difference.allFinite()) throw Error("friction fit: a sample is not finite");
}

double sum_squares(const JointFriction& f, const Eigen::VectorXd& dq, const Eigen::VectorXd& difference) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < dq.size(); ++i) {
    const double e = difference[i] - friction_torque(f, dq[i]);
    sum += e * e;
  }
  return sum;
}

/// Samples of like velocity put together: enough for the scan of a law that is smooth in it.
struct Bins {
  Eigen::VectorXd dq, difference, weight;
};

Bins bin(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference) {
  constexpr Eigen::Index most = 400;
  std::vector<Eigen::Index> order(static_cast<std::size_t>(dq.size()));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Eigen::Index>(i);
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return dq[a] < dq[b]; });
  const Eigen::Index count = std::min(most, dq.size());
  Bins bins{Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
  for (Eigen::Index i = 0; i < dq.size(); ++i) {
    const Eigen::Index k = i * count / dq.size(), s = order[static_cast<std::size_t>(i)];
    bins.dq[k] += dq[s];
    bins.difference[k] += difference[s];
    bins.weight[k] += 1.0;
  }
  bins.dq.array() /= bins.weight.array();
  bins.difference.array() /= bins.weight.array();
  return bins;
}

/// The best phi1 for given (phi2, phi3) and the energy that it explains.
std::array<double, 2> explained(const Bins& bins, double phi2, double phi3) {
  const SigmoidFriction unit{1.0, phi2, phi3};
  double ss = 0.0, sd = 0.0;
  for (Eigen::Index k = 0; k < bins.dq.size(); ++k) {
    const double s = friction_torque(unit, bins.dq[k]);
    ss += bins.weight[k] * s * s;
    sd += bins.weight[k] * s * bins.difference[k];
  }
  return ss > 0.0 ? std::array<double, 2>{sd / ss, sd * sd / ss} : std::array<double, 2>{0.0, 0.0};
}

FrictionFit refine(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference, SigmoidFriction start) {
  FrictionFit fit;
  fit.friction.sigmoid = start;
  fit.sum_squares = sum_squares(fit.friction, dq, difference);
  double damping = 1e-3;
  int rejected = 0;
  for (int iteration = 0; iteration < 200 && rejected < 12; ++iteration) {
    Eigen::Matrix3d JtJ = Eigen::Matrix3d::Zero();
    Eigen::Vector3d Jte = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < dq.size(); ++i) {
      const Eigen::RowVector3d row = friction_regressor(fit.friction.sigmoid, dq[i]);
      JtJ.noalias() += row.transpose() * row;
      Jte.noalias() += row.transpose() * (difference[i] - friction_torque(fit.friction.sigmoid, dq[i]));
    }
    ++fit.evaluations;
    bool accepted = false;
    for (; rejected < 12; ++rejected) {
      Eigen::Matrix3d H = JtJ;
      H.diagonal() += damping * (JtJ.diagonal().array() + 1e-12 * JtJ.diagonal().maxCoeff()).matrix();
      const Eigen::Vector3d step = H.ldlt().solve(Jte);
      JointFriction trial = fit.friction;
      trial.sigmoid = {trial.sigmoid.phi1 + step[0], trial.sigmoid.phi2 + step[1],
                       trial.sigmoid.phi3 + step[2]};
      const double sum = step.allFinite() ? sum_squares(trial, dq, difference) : fit.sum_squares;
      ++fit.evaluations;
      if (sum < fit.sum_squares) {
        const double gain = (fit.sum_squares - sum) / fit.sum_squares;
        fit.friction = trial;
        fit.sum_squares = sum;
        damping = std::max(0.2 * damping, 1e-12);
        accepted = gain > 1e-13;
        rejected = 0;
        break;
      }
      damping *= 5.0;
    }
    if (!accepted) break;
  }
  return fit;
}

/// The rows of blocks other than `fold` (kept) or of that block alone.
Eigen::VectorXd rows_of(const Eigen::VectorXd& x, int fold, int folds, bool held_out) {
  std::vector<double> out;
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if ((i * folds / x.size() == fold) == held_out) out.push_back(x[i]);
  return Eigen::Map<Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
}

}  // namespace

FrictionFit fit_linear_friction(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                double velocity_scale) {
  check(dq, difference);
  FrictionFit fit;
  fit.friction.linear.velocity_scale = velocity_scale;
  Eigen::MatrixXd A(dq.size(), 3);
  for (Eigen::Index i = 0; i < dq.size(); ++i) A.row(i) = friction_regressor(fit.friction.linear, dq[i]);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  if (qr.rank() < 3)
    throw Error(
        "friction fit: these velocities do not tell viscous friction, Coulomb friction and offset apart");
  const Eigen::Vector3d x = qr.solve(difference);
  fit.friction.linear.viscous = x[0];
  fit.friction.linear.coulomb = x[1];
  fit.friction.linear.offset = x[2];
  fit.sum_squares = sum_squares(fit.friction, dq, difference);
  fit.evaluations = 1;
  return fit;
}

FrictionFit fit_sigmoid_friction_nelder_mead(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                             const SigmoidFriction& start) {
  check(dq, difference);
  FrictionFit fit;
  const auto cost = [&](const std::vector<double>& x) {
    ++fit.evaluations;
    JointFriction f;
    f.sigmoid = {x[0], x[1], x[2]};
    return sum_squares(f, dq, difference);
  };
  using Cost = decltype(cost);
  nlopt::opt search(nlopt::LN_NELDERMEAD, 3);
  search.set_min_objective([](const std::vector<double>& x, std::vector<double>&,
                              void* data) { return (*static_cast<Cost*>(data))(x); },
                           const_cast<void*>(static_cast<const void*>(&cost)));
  search.set_xtol_rel(1e-10);
  search.set_maxeval(4000);
  std::vector<double> x = {start.phi1, start.phi2, start.phi3};
  double value = 0.0;
  try {
    search.optimize(x, value);
  } catch (const nlopt::roundoff_limited&) {  // as good as it gets: x holds the best point
  }
  fit.friction.sigmoid = {x[0], x[1], x[2]};
  fit.sum_squares = sum_squares(fit.friction, dq, difference);
  return fit;
}

FrictionFit fit_sigmoid_friction(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference) {
  check(dq, difference);
  const Bins bins = bin(dq, difference);
  const double fastest = std::max(dq.cwiseAbs().maxCoeff(), 1e-9);
  struct Cell {
    double energy, phi1, phi2, phi3;
  };
  // From nearly straight over the velocities seen (phi2 fastest = 0.3) to a step between two of them, and
  // with the middle of the curve anywhere among them.
  std::vector<Cell> cells;
  constexpr int slopes = 28, shifts = 25;
  for (int a = 0; a < slopes; ++a) {
    for (int b = 0; b < shifts; ++b) {
      const double phi2 = 0.3 / fastest * std::pow(3000.0, double(a) / (slopes - 1));
      // Denser near zero, where the curve bends.
      const double u = 2.0 * b / (shifts - 1) - 1.0;
      const double phi3 = fastest * u * std::abs(u);
      const auto [phi1, energy] = explained(bins, phi2, phi3);
      cells.push_back({energy, phi1, phi2, phi3});
    }
  }
  constexpr std::size_t best = 6;
  std::partial_sort(cells.begin(), cells.begin() + best, cells.end(),
                    [](const Cell& a, const Cell& b) { return a.energy > b.energy; });
  FrictionFit fit;
  fit.sum_squares = difference.squaredNorm();  // phi1 = 0: no friction at all
  fit.friction.sigmoid = {0.0, 1.0 / fastest, 0.0};
  int evaluations = slopes * shifts;
  for (std::size_t k = 0; k < best; ++k) {
    const FrictionFit trial = refine(dq, difference, {cells[k].phi1, cells[k].phi2, cells[k].phi3});
    evaluations += trial.evaluations;
    if (trial.sum_squares < fit.sum_squares) fit = trial;
  }
  fit.evaluations = evaluations;
  return fit;
}

FrictionChoice choose_friction_law(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                   double velocity_scale, int folds) {
  check(dq, difference);
  if (folds < 2 || dq.size() < 4 * folds)
    throw Error("friction fit: " + std::to_string(dq.size()) + " samples are too few for " +
                std::to_string(folds) + " held-out blocks");
  FrictionChoice choice;
  for (int fold = 0; fold < folds; ++fold) {
    const Eigen::VectorXd v = rows_of(dq, fold, folds, false), d = rows_of(difference, fold, folds, false);
    const Eigen::VectorXd v_out = rows_of(dq, fold, folds, true),
                          d_out = rows_of(difference, fold, folds, true);
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
