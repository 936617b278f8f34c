// SPDX-License-Identifier: Apache-2.0
#include "intervals.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "dynid/diagnosis/calibration.hpp"

namespace dynid::detail {
namespace {

constexpr double difference = 1e-3;  // of a shape parameter, in parts of its scale
// Nominal models as far off as this one may be, that an effect is computed from: their sum of squares has a
// relative error of a half.
constexpr int models_off = 8;

/// The values of an effect over all its units, arrays over joints filled with zeros elsewhere.
struct Values {
  std::vector<std::string> keys, units;
  std::vector<bool> per_joint;
  std::vector<Eigen::VectorXd> values;
};
Values values_of(const Robot& robot, const Adopted& e, const Eigen::VectorXd& theta,
                 const std::vector<Eigen::VectorXd>& shapes) {
  Values out;
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < e.units.size(); ++k) {
    const Eigen::Index p = e.h->shape_only() ? 0 : e.units[k].block->size();
    const std::vector<NamedValue> named =
        e.h->parameters(robot, e.units[k].unit, theta.segment(at, p), shapes[k]);
    at += p;
    for (std::size_t i = 0; i < named.size(); ++i) {
      if (k == 0) {
        out.keys.push_back(named[i].key);
        out.units.push_back(named[i].unit);
        out.per_joint.push_back(named[i].per_joint);
        out.values.push_back(named[i].per_joint ? Eigen::VectorXd::Zero(robot.size()) : named[i].value);
      } else if (out.units[i].find(named[i].unit) == std::string::npos) {
        out.units[i] += " or " + named[i].unit;  // joints of both types
      }
      if (named[i].per_joint) out.values[i][e.units[k].unit] = named[i].value[0];
    }
  }
  return out;
}

/// Shape parameters of the effect's units that are measured, and the derivatives of its torque with respect
/// to them.
struct ShapeSlopes {
  std::vector<RowBlock> slopes;
  std::vector<std::pair<std::size_t, Eigen::Index>> of;  // unit, shape parameter
};
ShapeSlopes shape_slopes(const GapRows& rows, const Adopted& e, const Eigen::VectorXd& theta) {
  ShapeSlopes out;
  Eigen::Index offset = 0;
  for (std::size_t k = 0; k < e.units.size(); ++k) {
    const UnitShape& u = e.units[k];
    const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
    const std::vector<ShapeParameter> shape = rows.shape(*e.h, u.unit);
    const bool window = e.h->scope() == Scope::window;
    for (Eigen::Index s = 0; s < u.shape.size(); ++s) {
      const ShapeParameter& of = shape[static_cast<std::size_t>(s)];
      if (of.points < 3 && !window) continue;
      // A window's ends have no scale but the time between the rows.
      const double size = window && s < 2 ? rows.period() : of.size_at(u.shape[s]);
      const double step = difference * size;
      Eigen::VectorXd ahead = u.shape, behind = u.shape;
      ahead[s] += step;
      behind[s] -= step;
      const RowBlock a = rows.block(*e.h, u.unit, ahead), b = rows.block(*e.h, u.unit, behind);
      RowBlock slope;
      slope.channels = a.channels;
      for (std::size_t c = 0; c < a.channels.size(); ++c) {
        const Eigen::MatrixXd d = (a.values[c] - b.values[c]) / (2.0 * step);
        slope.values.push_back(p > 0 ? Eigen::MatrixXd(d * theta.segment(offset, p))
                                     : Eigen::MatrixXd(d.rowwise().sum()));
      }
      out.slopes.push_back(std::move(slope));
      out.of.emplace_back(k, s);
    }
    offset += p;
  }
  return out;
}

/// A root of the covariance of the effect's coefficients and measured shape parameters beside everything that
/// is free in the model: the noise's part times `factor`, and the part of a nominal model that is off where
/// effects are computed from it (a load, a limit), which no residual shows.
Eigen::MatrixXd root_of_covariance(const GapRows& rows, const GapModel& model, Eigen::Index first,
                                   Eigen::Index mine, const ShapeSlopes& shapes, double factor) {
  std::vector<Term> terms = terms_of(model.effects);
  const Eigen::Index all = model.fit.theta.size();
  for (const RowBlock& slope : shapes.slopes) terms.push_back({&slope});
  const Eigen::MatrixXd wide = covariance_of(rows, terms, model.fit.noise, model.kappa);
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index k = 0; k < mine; ++k) chosen.push_back(first + k);
  for (std::size_t k = 0; k < shapes.slopes.size(); ++k) chosen.push_back(all + static_cast<Eigen::Index>(k));
  Eigen::MatrixXd covariance = factor * factor * wide(chosen, chosen);
  if (model.kappa > 0.0) {
    const Eigen::MatrixXd as_it_is = contribution(rows, model, model.fit.theta);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0.0, model.kappa);
    for (int k = 0; k < models_off; ++k) {
      const Eigen::VectorXd parts =
          Eigen::VectorXd::NullaryExpr(10 * rows.joints(), [&] { return normal(random); });
      const Eigen::MatrixXd more =
          contribution(rows.with_links_off(parts), model, model.fit.theta) - as_it_is;
      if (more.isZero(0.0)) break;  // none of the effects is computed from it
      const Eigen::VectorXd moved =
          answer_to(rows, terms, more, model.fit.noise, model.kappa)(chosen) / std::sqrt(double(models_off));
      covariance += moved * moved.transpose();
    }
  }
  // What no row shows has an infinite variance: it stays where it is. And the variances of what some hardly
  // show are not to drown the others'.
  Eigen::VectorXd deviation = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  for (double& d : deviation) d = std::isfinite(d) ? d : 0.0;
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(deviation.size(), deviation.size());
  for (Eigen::Index i = 0; i < deviation.size(); ++i)
    for (Eigen::Index k = 0; k < i; ++k)
      if (deviation[i] > 0.0 && deviation[k] > 0.0)
        correlation(i, k) = covariance(i, k) / (deviation[i] * deviation[k]);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);  // reads the lower triangle
  return deviation.asDiagonal() * eigen.eigenvectors() *
         eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// One parameter: its value, the draws of it (values x draws), and the error of the effect's form.
ParameterEstimate estimate_of(const std::string& effect, const std::string& key, const std::string& unit,
                              bool per_joint, const Eigen::VectorXd& values, const Eigen::MatrixXd& drawn,
                              const Calibration& by) {
  ParameterEstimate out{key, unit, values, values, values, per_joint};
  const Eigen::Index draws = drawn.cols();
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    Eigen::VectorXd x = drawn.row(i).transpose();
    std::sort(x.data(), x.data() + x.size());
    const double value = out.value[i], below = std::max(0.0, value - x[draws / 20]),
                 above = std::max(0.0, x[draws - 1 - draws / 20] - value);
    // What is chosen (a link, a sign), not measured, has no interval.
    const bool measured = below > 0.0 || above > 0.0;
    const double form = measured ? by.form_error_of(effect, key) * Calibration::scale(out, i) : 0.0;
    out.low[i] = value - std::hypot(below, form);
    out.high[i] = value + std::hypot(above, form);
  }
  return out;
}

}  // namespace

FoundEffect found_effect(const Robot& robot, const GapRows& rows, const GapModel& model, std::size_t which,
                         unsigned seed, const Calibration& by) {
  const Adopted& e = model.effects[which];
  Eigen::Index first = 0;
  for (std::size_t k = 0; k < which; ++k) first += model.effects[k].coefficients();
  const Eigen::Index mine = e.coefficients();
  const Eigen::VectorXd theta = model.fit.theta.segment(first, mine);
  const ShapeSlopes slopes = shape_slopes(rows, e, theta);
  const double factor = model.kappa > 0.0 ? by.interval_factor_off : by.interval_factor;
  const Eigen::MatrixXd root = root_of_covariance(rows, model, first, mine, slopes, factor);
  std::vector<Eigen::VectorXd> shapes;
  for (const UnitShape& u : e.units) shapes.push_back(u.shape);
  const Values best = values_of(robot, e, theta, shapes);
  constexpr int draws = 400;
  std::vector<Eigen::MatrixXd> drawn;
  for (const Eigen::VectorXd& v : best.values) drawn.emplace_back(v.size(), draws);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (int d = 0; d < draws; ++d) {
    Eigen::VectorXd z(root.cols());
    for (double& x : z) x = normal(random);
    const Eigen::VectorXd change = root * z;
    std::vector<Eigen::VectorXd> moved = shapes;
    for (std::size_t k = 0; k < slopes.of.size(); ++k) {
      const auto& [unit, s] = slopes.of[k];
      const ShapeParameter range = rows.shape(*e.h, e.units[unit].unit)[static_cast<std::size_t>(s)];
      moved[unit][s] =
          std::clamp(moved[unit][s] + change[mine + static_cast<Eigen::Index>(k)], range.low, range.high);
    }
    const Values v = values_of(robot, e, theta + change.head(mine), moved);
    for (std::size_t k = 0; k < v.values.size(); ++k) drawn[k].col(d) = v.values[k];
  }
  FoundEffect found;
  found.effect.name = e.h->name();
  for (const UnitShape& u : e.units)
    for (const int j : e.h->joints(robot, u.unit)) found.effect.joints.push_back(j);
  for (std::size_t k = 0; k < best.keys.size(); ++k) {
    found.effect.parameters[best.keys[k]] =
        std::vector<double>(best.values[k].data(), best.values[k].data() + best.values[k].size());
    found.parameters.push_back(estimate_of(e.h->name(), best.keys[k], best.units[k], best.per_joint[k],
                                           best.values[k], drawn[k], by));
  }
  return found;
}

}  // namespace dynid::detail
