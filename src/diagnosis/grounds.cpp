// SPDX-License-Identifier: Apache-2.0
#include "grounds.hpp"

#include <algorithm>
#include <cmath>

#include "energy.hpp"
#include "held_out.hpp"
#include "split.hpp"

namespace dynid::detail {
namespace {

constexpr double tiny = 1e-6;  // of shares and ratios: their logarithm ends there

/// Rows in which an effect can be judged, and what each effect adds there with what was fitted elsewhere.
struct Trial {
  GapRows rows;
  std::vector<Eigen::MatrixXd> own;
};
/// `other_log`: the rows are not of the log that the effects were found in, where a window of that one's
/// clock says nothing.
Trial trial(const GapRows& rows, const GapModel& model, bool other_log = false) {
  Trial out{rows, {}};
  for (std::size_t k = 0; k < model.effects.size(); ++k)
    out.own.push_back(other_log && model.effects[k].h->scope() == Scope::window
                          ? Eigen::MatrixXd(Eigen::MatrixXd::Zero(rows.size(), rows.joints()))
                          : contribution(rows, model, model.fit.theta, static_cast<std::ptrdiff_t>(k)));
  return out;
}

Eigen::MatrixXd left_in(const Trial& t, double kappa) {
  Eigen::MatrixXd left = t.rows.y;
  for (const Eigen::MatrixXd& own : t.own) left -= own;
  return fit_terms(t.rows, left, {}, kappa).residual;
}

/// Energy of each joint in units of its floor, a row.
Eigen::VectorXd by_joint(const Eigen::MatrixXd& x, const Eigen::VectorXd& floor) {
  return rms(x).cwiseQuotient(floor).cwiseAbs2();
}

/// Part of the gap (rms) beyond the floor that is left on the joints where `own` acts, each as far as it
/// does.
double rest_of(const Eigen::VectorXd& before, const Eigen::VectorXd& after, const Eigen::VectorXd& own) {
  double gap = 0.0, left = 0.0;
  for (Eigen::Index j = 0; j < own.size(); ++j) {
    const double weight = own[j] / std::max(before[j], own[j] + 1e-300);
    gap += weight * std::max(0.0, before[j] - 1.0);
    left += weight * std::max(0.0, after[j] - 1.0);
  }
  return gap > 0.0 ? std::sqrt(std::clamp(left / gap, 0.0, 1.0)) : 1.0;
}

}  // namespace

FormError form_error(const Choice& choice, const GapModel& model, std::size_t but) {
  const GapRows& rows = choice.rows;
  const int n = rows.joints();
  FormError out{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    // A window's form error is in the window.
    if (k == but || model.effects[k].h->scope() == Scope::window) continue;
    const double part = model.effects[k].h->approximate() ? choice.criteria().form_of_approximate
                                                          : choice.criteria().form_of_exact;
    const Eigen::MatrixXd torque = part * own_contribution(model, k);
    for (int j = 0; j < n; ++j) {
      if (torque.col(j).isZero(0.0)) continue;
      const ChannelNoise& noise = model.fit.noise[static_cast<std::size_t>(j)];
      const Eigen::MatrixXd white = whitened(rows, torque.col(j), noise);
      out.size[j] += torque.col(j).squaredNorm() / double(rows.size());
      out.innovation[j] += noise.variance * white.squaredNorm() / double(white.rows());
    }
  }
  return out;
}

std::vector<Grounds> grounds_of(const Choice& choice, const GapModel& model,
                                const std::vector<double>& shares, const Eigen::VectorXd& floor) {
  const std::size_t count = model.effects.size();
  std::vector<Grounds> out(count);
  if (count == 0) return out;
  // What does not come back, or does not act in the rows that judge, can only be judged beside where it was
  // found; and what is too brief for that, where it was found.
  const GapModel within = fitted_within(choice.rows, model);
  const Trial held = trial(choice.held, model, choice.split.several),
              near = trial(GapRows(choice.rows, alternate(choice.rows, false, within_length(choice.rows), 1)),
                           within);
  const Eigen::VectorXd before = by_joint(choice.rows.y, floor), after = by_joint(model.fit.residual, floor);
  const Trial found = trial(choice.rows, model);
  const auto judged = [&](std::size_t k) -> const Trial& {
    // What does not come back goes on in the rows that a log alone keeps to judge.
    const bool there = !model.effects[k].h->once() || !choice.split.several;
    if (!choice.split.alone && there && shows(held.own[k], found.own[k], floor)) return held;
    return shows(near.own[k], found.own[k], floor) ? near : found;
  };
  const Eigen::MatrixXd held_left = left_in(held, model.kappa), near_left = left_in(near, within.kappa),
                        &found_left = model.fit.residual;
  for (std::size_t k = 0; k < count; ++k) {
    Grounds& g = out[k];
    const Trial& t = judged(k);
    const Eigen::MatrixXd& left = &t == &held ? held_left : &t == &near ? near_left : found_left;
    const double own = energy(t.own[k], floor);
    g[Ground::transfer] =
        own > 0.0 ? std::clamp((energy(left + t.own[k], floor) - energy(left, floor)) / own, -1.0, 1.0) : 0.0;
    const Eigen::MatrixXd torque = own_contribution(model, k);
    g[Ground::rest] = rest_of(before, after, by_joint(torque, floor));
    g[Ground::rest_held] =
        rest_of(by_joint(t.rows.y, floor), by_joint(left, floor), by_joint(t.own[k], floor));
    g[Ground::share] = std::log10(std::max(tiny, shares[k]));
    const FormError form = form_error(choice, model, k);
    const Eigen::ArrayXd size = rms(torque).array();
    g[Ground::above_form] =
        0.5 * std::log10(
                  std::clamp((size.square() / (form.size.array() + 1e-4 * floor.array().square())).maxCoeff(),
                             tiny, 1.0 / tiny));
    g[Ground::above_floor] = std::log10(std::max(tiny, (size / floor.array()).maxCoeff()));
    g[Ground::company] = std::log(double(count));
    g[Ground::approximate] = model.effects[k].h->approximate() ? 1.0 : 0.0;
    g[Ground::window] = model.effects[k].h->once() ? 1.0 : 0.0;
  }
  return out;
}

}  // namespace dynid::detail
