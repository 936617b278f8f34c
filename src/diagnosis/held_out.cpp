// SPDX-License-Identifier: Apache-2.0
#include "held_out.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "energy.hpp"
#include "fit.hpp"
#include "split.hpp"

namespace dynid::detail {

namespace {

// Energy that an effect has to have in rows that are to judge it: in units of the floor, five standard
// deviations of noise; and of what it has where it was found.
constexpr double least_shown = 25.0, least_part_shown = 0.01;

/// The gap, and what is left of it, in rows of which `block` says which belong together.
Shrink shrink_of(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
                 const std::vector<double>& block, const Eigen::VectorXd& floor, unsigned seed) {
  Shrink shrink;
  shrink.before = rms(before);
  shrink.after = rms(after);
  shrink.floor = floor;
  shrink.fraction = shrink_fraction(before, after, floor);
  // Blocks drawn with replacement.
  std::vector<std::vector<Eigen::Index>> blocks;
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (i == 0 || block[i] != block[i - 1]) blocks.emplace_back();
    blocks.back().push_back(static_cast<Eigen::Index>(i));
  }
  std::mt19937_64 random(seed);
  std::vector<double> fractions;
  for (int k = 0; k < 200; ++k) {
    std::vector<Eigen::Index> drawn;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const auto& here = blocks[random() % blocks.size()];
      drawn.insert(drawn.end(), here.begin(), here.end());
    }
    fractions.push_back(shrink_fraction(before(drawn, Eigen::all), after(drawn, Eigen::all), floor));
  }
  std::sort(fractions.begin(), fractions.end());
  shrink.low = std::min(shrink.fraction, fractions[10]);
  shrink.high = std::max(shrink.fraction, fractions[189]);
  return shrink;
}

/// The block of `seconds` that each row is in.
std::vector<double> blocks_of(const GapRows& rows, double seconds) {
  std::vector<double> out;
  for (Eigen::Index i = 0; i < rows.size(); ++i)
    out.push_back(std::floor(rows.t[i] / seconds) + 1e6 * rows.log[static_cast<std::size_t>(i)]);
  return out;
}

/// The model fitted on a part of the rows that it was fitted on. A part may not show all of it (a joint that
/// sticks there has nothing to say): where it does not, what is known before is that each unit is about as
/// large, as the whole sees it, as it was found there.
GapModel fitted_on(const GapRows& rows, const GapRows& whole, const GapModel& model) {
  GapModel part = model;
  part.effects = carried(rows, model.effects);
  part.fit = fit_of(rows, part.effects, model.kappa);
  if (part.fit.theta.size() == 0) return part;
  const auto information = [&](const GapRows& of, const std::vector<Adopted>& effects) {
    return information_of(of, terms_of(effects), model.fit.noise, model.kappa);
  };
  const Eigen::MatrixXd here = information(rows, part.effects),
                        all = information(whole, carried(whole, model.effects));
  Eigen::MatrixXd sum = here;
  Eigen::Index at = 0;
  for (const Adopted& e : model.effects)
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      const auto own = all.block(at, at, p, p);
      const Eigen::VectorXd theta = model.fit.theta.segment(at, p);
      sum.block(at, at, p, p) += own * (double(p) / std::max(theta.dot(own * theta), double(p)));
      at += p;
    }
  part.fit.theta = solve(sum, here * part.fit.theta, nullptr);
  return part;
}

}  // namespace

Shrink shrink_of(const GapRows& rows, const Eigen::MatrixXd& after, const Eigen::VectorXd& floor,
                 unsigned seed) {
  return shrink_of(rows.y, after, blocks_of(rows, block_length(rows)), floor, seed);
}

bool shows(const Eigen::MatrixXd& there, const Eigen::MatrixXd& found, const Eigen::VectorXd& floor) {
  const double here = energy(there, floor);
  return here * double(there.rows()) > least_shown && here > least_part_shown * energy(found, floor);
}

GapModel fitted_within(const GapRows& rows, const GapModel& model) {
  return fitted_on(GapRows(rows, alternate(rows, true, within_length(rows), 1)), rows, model);
}

namespace {

/// The gap, and what is left of it, where either half judges what the other has fitted: what is brief may be
/// in one of them alone.
struct Within {
  Eigen::MatrixXd before, after;
  std::vector<double> block;
};
/// `nominal_too`: what the nominal model's errors explain in the judging half is not left.
Within judged_by_halves(const GapRows& rows, const GapModel& model, bool nominal_too) {
  const double length = within_length(rows);
  Within out{Eigen::MatrixXd(0, rows.joints()), Eigen::MatrixXd(0, rows.joints()), {}};
  for (const bool fits : {true, false}) {
    const GapRows fitting(rows, alternate(rows, fits, length, 1)),
        judging(rows, alternate(rows, !fits, length, 1));
    const GapModel part = fitted_on(fitting, rows, model);
    const Eigen::MatrixXd left = judging.y - contribution(judging, part, part.fit.theta);
    const Eigen::Index first = out.before.rows();
    out.before.conservativeResize(first + judging.size(), Eigen::NoChange);
    out.after.conservativeResize(first + judging.size(), Eigen::NoChange);
    out.before.bottomRows(judging.size()) = judging.y;
    out.after.bottomRows(judging.size()) =
        nominal_too ? fit_terms(judging, left, {}, model.kappa).residual : left;
    for (const double b : blocks_of(judging, block_length(rows))) out.block.push_back(b);
  }
  return out;
}

}  // namespace

Shrink shrink_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor,
                     unsigned seed) {
  const Within w = judged_by_halves(rows, model, false);
  return shrink_of(w.before, w.after, w.block, floor, seed);
}

double explained_within(const GapRows& rows, const GapModel& model, const Eigen::VectorXd& floor) {
  const Within w = judged_by_halves(rows, model, true);
  return shrink_fraction(w.before, w.after, floor);
}

}  // namespace dynid::detail
