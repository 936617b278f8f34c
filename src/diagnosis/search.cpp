// SPDX-License-Identifier: Apache-2.0
#include "search.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dynid::detail {
namespace {

constexpr double joint_gain = 6.0;    // log evidence that a further joint of an effect has to bring
constexpr double effect_gain = 10.0;  // and a further effect
constexpr double least_part = 0.02;   // of the explained energy that a further effect has to make

std::vector<Eigen::VectorXd> grid_of(const std::vector<ShapeParameter>& shape) {
  std::vector<Eigen::VectorXd> points = {Eigen::VectorXd(0)};
  for (const ShapeParameter& s : shape) {
    std::vector<Eigen::VectorXd> next;
    for (const Eigen::VectorXd& p : points) {
      for (int k = 0; k < s.points; ++k) {
        const double part = s.points > 1 ? double(k) / (s.points - 1) : 0.0;
        Eigen::VectorXd q(p.size() + 1);
        q << p, s.logarithmic ? s.low * std::pow(s.high / s.low, part) : s.low + part * (s.high - s.low);
        next.push_back(q);
      }
    }
    points = next;
  }
  return points;
}

bool own_channel(const Hypothesis& h, const RowBlock& block) {
  return h.scope() == Scope::joint && block.channels.size() == 1;
}

std::vector<Term> terms_of(const std::vector<Adopted>& effects) {
  std::vector<Term> terms;
  for (const Adopted& e : effects)
    for (const UnitShape& u : e.units) terms.push_back({u.block.get(), e.h->shape_only()});
  return terms;
}

}  // namespace

Eigen::Index Adopted::coefficients() const {
  Eigen::Index size = 0;
  for (const UnitShape& u : units) size += h->shape_only() ? 0 : u.block->size();
  return size;
}

Search::Search(const GapRows& rows, std::vector<const Hypothesis*> library)
    : rows_(rows), library_(std::move(library)), grids_(library_.size()) {
  struct Job {
    std::size_t h;
    int unit;
    std::size_t point;
  };
  std::vector<Job> jobs;
  for (std::size_t k = 0; k < library_.size(); ++k) {
    const Hypothesis& h = *library_[k];
    std::vector<Eigen::VectorXd> points = grid_of(h.shape());
    if (h.scope() == Scope::window) points = {Eigen::Vector2d(-1e9, 2e9)};
    grids_[k].resize(static_cast<std::size_t>(h.units(rows.motions().front().robot())));
    for (std::size_t u = 0; u < grids_[k].size(); ++u) {
      for (const Eigen::VectorXd& p : points) {
        jobs.push_back({k, static_cast<int>(u), grids_[k][u].size()});
        grids_[k][u].push_back({p, nullptr});
      }
    }
  }
  // What a motion computes once for all is computed before it is shared.
  for (const GapMotion& motion : rows.motions()) motion.wrench_columns(0, 0);
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t k) {
    GridPoint& point = grids_[jobs[k].h][static_cast<std::size_t>(jobs[k].unit)][jobs[k].point];
    point.block = std::make_shared<RowBlock>(rows_.block(*library_[jobs[k].h], jobs[k].unit, point.shape));
  });
}

double Search::cost(const Adopted& effect) const {
  const double sample = std::log(double(rows_.size()));
  const auto units = static_cast<double>(effect.units.size());
  const auto shapes = static_cast<double>(effect.h->shape().size());
  // Each coefficient and each shape parameter by Schwarz, the choice of joints by its number of outcomes.
  double cost = (0.5 * sample + 1.5) * (double(effect.coefficients()) + units * shapes) -
                score_temperature * std::log(effect.h->prior());
  if (effect.h->scope() == Scope::window) cost += 2.0 * sample;
  if (effect.h->scope() != Scope::arm) cost += units * std::log(double(rows_.joints()));
  return cost;
}

GapModel Search::evaluate(std::vector<Adopted> effects, double kappa) const {
  GapModel model;
  model.fit = fit_terms(rows_, rows_.y, terms_of(effects), kappa);
  model.score = model.fit.total;
  for (const Adopted& e : effects) model.score -= cost(e);
  model.effects = std::move(effects);
  model.kappa = kappa;
  return model;
}

UnitShape Search::made(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const {
  return {unit, shape, std::make_shared<RowBlock>(rows_.block(h, unit, shape))};
}

double Search::unit_gain(const Hypothesis& h, const RowBlock& block, const GapModel& base) const {
  if (own_channel(h, block)) {
    const int j = block.channels[0];
    Eigen::VectorXd y = base.fit.left.col(j);
    if (h.shape_only()) {
      y -= block.values[0].rowwise().sum();
      return fit_channel(rows_, j, y, Eigen::MatrixXd(y.size(), 0), base.kappa).evidence -
             base.fit.evidence[j];
    }
    const ChannelFit fit = fit_channel(rows_, j, y, block.values[0], base.kappa);
    return fit.evidence - base.fit.evidence[j];
  }
  return fit_terms(rows_, base.fit.left, {{&block, h.shape_only()}}, base.kappa).total - base.fit.total;
}

UnitShape Search::refined(const Hypothesis& h, UnitShape unit, const GapModel& base) const {
  const std::vector<ShapeParameter> shape = h.shape();
  if (shape.empty() || h.scope() == Scope::window) return unit;
  double best = unit_gain(h, *unit.block, base);
  for (int pass = 0; pass < (shape.size() > 1 ? 2 : 1); ++pass) {
    for (Eigen::Index s = 0; s < unit.shape.size(); ++s) {
      const ShapeParameter& p = shape[static_cast<std::size_t>(s)];
      if (p.points < 3) continue;
      const bool log = p.logarithmic;
      const auto to = [log](double x) { return log ? std::log(x) : x; };
      const double step = (to(p.high) - to(p.low)) / (p.points - 1);
      double low = std::max(to(p.low), to(unit.shape[s]) - step),
             high = std::min(to(p.high), to(unit.shape[s]) + step);
      const auto value = [&](double x, UnitShape& out) {
        Eigen::VectorXd at = unit.shape;
        at[s] = log ? std::exp(x) : x;
        out = made(h, unit.unit, at);
        return unit_gain(h, *out.block, base);
      };
      // Golden section.
      const double g = 0.6180339887498949;
      double a = high - g * (high - low), b = low + g * (high - low);
      UnitShape at_a, at_b;
      double fa = value(a, at_a), fb = value(b, at_b);
      for (int k = 0; k < 10; ++k) {
        if (fa > fb) {
          high = b, b = a, fb = fa, at_b = at_a;
          a = high - g * (high - low);
          fa = value(a, at_a);
        } else {
          low = a, a = b, fa = fb, at_a = at_b;
          b = low + g * (high - low);
          fb = value(b, at_b);
        }
      }
      if (fa > best) best = fa, unit = at_a;
      if (fb > best) best = fb, unit = at_b;
    }
  }
  return unit;
}

Adopted Search::propose_own(const Hypothesis& h, const Grid& grid, const GapModel& base) const {
  Adopted effect{&h, {}, 0.0};
  const double sample = std::log(double(rows_.size()));
  for (std::size_t u = 0; u < grid.size(); ++u) {
    double best = -std::numeric_limits<double>::infinity();
    const GridPoint* point = nullptr;
    for (const GridPoint& p : grid[u]) {
      const double gain = unit_gain(h, *p.block, base);
      if (gain > best) best = gain, point = &p;
    }
    const double price =
        (0.5 * sample + 1.5) * double((h.shape_only() ? 0 : point->block->size()) + point->shape.size()) +
        std::log(double(rows_.joints()));
    if (best - price < -0.5 * joint_gain && !effect.units.empty()) continue;
    UnitShape unit = refined(h, {static_cast<int>(u), point->shape, point->block}, base);
    const double gain = unit_gain(h, *unit.block, base) - price;
    if (!h.shape_only()) {
      const ChannelFit fit =
          fit_channel(rows_, static_cast<int>(u), base.fit.left.col(static_cast<Eigen::Index>(u)),
                      unit.block->values[0], base.kappa);
      if (!h.plausible(rows_.motions().front().robot(), static_cast<int>(u), fit.theta, unit.shape)) continue;
    }
    if (gain < joint_gain) continue;
    effect.units.push_back(unit);
    effect.gain += gain;
  }
  return effect;
}

Adopted Search::propose_coupled(const Hypothesis& h, const Grid& grid, const GapModel& base) const {
  Adopted effect{&h, {}, 0.0};
  const double sample = std::log(double(rows_.size()));
  const auto price = [&](const UnitShape& u) {
    return (0.5 * sample + 1.5) * double((h.shape_only() ? 0 : u.block->size()) + u.shape.size()) +
           (h.scope() == Scope::arm ? 0.0 : std::log(double(rows_.joints())));
  };
  std::vector<UnitShape> best(grid.size());
  std::vector<double> gains(grid.size());
  tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t u) {
    double most = -std::numeric_limits<double>::infinity();
    for (const GridPoint& p : grid[u]) {
      const double gain = unit_gain(h, *p.block, base);
      if (gain > most) most = gain, best[u] = {static_cast<int>(u), p.shape, p.block};
    }
    gains[u] = most - price(best[u]);
  });
  const auto first = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
  best[first] = refined(h, best[first], base);
  effect.units = {best[first]};
  effect.gain = unit_gain(h, *best[first].block, base) - price(best[first]);
  if (h.scope() == Scope::joint) {
    std::vector<bool> used(grid.size(), false);
    used[first] = true;
    const auto total = [&](const std::vector<UnitShape>& units) {
      std::vector<Term> terms;
      double sum = 0.0;
      for (const UnitShape& u : units) {
        terms.push_back({u.block.get(), h.shape_only()});
        sum -= price(u);
      }
      return sum + fit_terms(rows_, base.fit.left, terms, base.kappa).total - base.fit.total;
    };
    while (effect.units.size() < grid.size()) {
      double most = effect.gain + joint_gain;
      std::size_t next = grid.size();
      for (std::size_t u = 0; u < grid.size(); ++u) {
        if (used[u]) continue;
        std::vector<UnitShape> more = effect.units;
        more.push_back(best[u]);
        const double value = total(more);
        if (value > most) most = value, next = u;
      }
      if (next == grid.size()) break;
      used[next] = true;
      effect.units.push_back(best[next]);
      effect.gain = most;
    }
    std::sort(effect.units.begin(), effect.units.end(),
              [](const UnitShape& a, const UnitShape& b) { return a.unit < b.unit; });
  }
  if (effect.units.size() == 1 && !h.shape_only()) {
    const Fit fit = fit_terms(rows_, base.fit.left, {{effect.units[0].block.get(), false}}, base.kappa);
    if (!h.plausible(rows_.motions().front().robot(), effect.units[0].unit, fit.theta, effect.units[0].shape))
      effect.units.clear();
  }
  return effect;
}

Adopted Search::propose_window(const Hypothesis& h, const Grid& grid, const GapModel& base) const {
  // Scan: gain of a window for each link by prefix sums of its normal equations, rows taken as independent.
  const Eigen::Index size = rows_.size();
  double most = 0.0;
  int link = -1;
  Eigen::Index from = 0, to = 0;
  for (std::size_t u = 0; u < grid.size(); ++u) {
    const RowBlock& block = *grid[u][0].block;
    const Eigen::Index p = block.size();
    std::vector<Eigen::MatrixXd> sum(static_cast<std::size_t>(size) + 1, Eigen::MatrixXd::Zero(p, p + 1));
    for (Eigen::Index i = 0; i < size; ++i) {
      Eigen::MatrixXd& next = sum[static_cast<std::size_t>(i) + 1];
      next = sum[static_cast<std::size_t>(i)];
      for (std::size_t c = 0; c < block.channels.size(); ++c) {
        const int j = block.channels[c];
        const Eigen::VectorXd row = block.values[c].row(i).transpose();
        const double w = 1.0 / base.fit.noise[static_cast<std::size_t>(j)].variance;
        next.leftCols(p) += w * row * row.transpose();
        next.col(p) += w * base.fit.left(i, j) * row;
      }
    }
    for (std::size_t part = 0; part + 1 < rows_.parts.size(); ++part) {
      const Eigen::Index first = rows_.parts[part], last = rows_.parts[part + 1];
      for (Eigen::Index length = 5; length <= std::min<Eigen::Index>(last - first, size / 2);
           length = std::max(length + 1, length * 5 / 4)) {
        for (Eigen::Index i = first; i + length <= last; i += std::max<Eigen::Index>(1, length / 12)) {
          const Eigen::MatrixXd d =
              sum[static_cast<std::size_t>(i + length)] - sum[static_cast<std::size_t>(i)];
          Eigen::MatrixXd G = d.leftCols(p);
          G.diagonal().array() += 1e-6 * G.trace() + 1e-12;
          const double gain = 0.5 * d.col(p).dot(G.llt().solve(d.col(p)));
          if (gain > most) most = gain, link = static_cast<int>(u), from = i, to = i + length - 1;
        }
      }
    }
  }
  Adopted effect{&h, {}, 0.0};
  if (link < 0) return effect;
  // The ends, row by row, by what the full fit says.
  const auto window = [&](Eigen::Index a, Eigen::Index b) {
    return made(h, link, Eigen::Vector2d(rows_.t[a], rows_.t[b] - rows_.t[a]));
  };
  UnitShape best = window(from, to);
  double gain = unit_gain(h, *best.block, base);
  for (Eigen::Index step = std::max<Eigen::Index>(1, (to - from) / 8); step >= 1; step /= 2) {
    for (bool moved = true; moved;) {
      moved = false;
      for (const auto& [a, b] : {std::pair{from - step, to}, std::pair{from + step, to},
                                 std::pair{from, to - step}, std::pair{from, to + step}}) {
        if (a < 0 || b >= size || b - a < 4 ||
            rows_.log[static_cast<std::size_t>(a)] != rows_.log[static_cast<std::size_t>(b)])
          continue;
        const UnitShape other = window(a, b);
        const double value = unit_gain(h, *other.block, base);
        if (value > gain + 1e-6) {
          gain = value, best = other, from = a, to = b;
          moved = true;
          break;
        }
      }
    }
  }
  effect.units = {best};
  effect.gain = gain - cost(effect);
  return effect;
}

Adopted Search::propose(const Hypothesis& h, const Grid& grid, const GapModel& base) const {
  if (h.scope() == Scope::window) return propose_window(h, grid, base);
  if (own_channel(h, *grid[0][0].block)) return propose_own(h, grid, base);
  return propose_coupled(h, grid, base);
}

std::vector<GapModel> Search::alternatives(const GapModel& base, std::size_t joint_refits) const {
  std::vector<Adopted> proposed(library_.size());
  tbb::parallel_for(std::size_t{0}, library_.size(), [&](std::size_t k) {
    for (const Adopted& e : base.effects)
      if (e.h == library_[k]) return;  // once each: another joint of it is a matter of the first choice
    proposed[k] = propose(*library_[k], grids_[k], base);
  });
  std::vector<Adopted> useful;
  for (Adopted& e : proposed)
    if (e.h != nullptr && !e.units.empty() && e.gain > 0.0) useful.push_back(std::move(e));
  std::stable_sort(useful.begin(), useful.end(),
                   [](const Adopted& a, const Adopted& b) { return a.gain > b.gain; });
  if (useful.size() > joint_refits) useful.resize(joint_refits);
  std::vector<GapModel> models(useful.size());
  tbb::parallel_for(std::size_t{0}, useful.size(), [&](std::size_t k) {
    std::vector<Adopted> effects = base.effects;
    effects.push_back(useful[k]);
    models[k] = evaluate(std::move(effects), base.kappa);
  });
  std::stable_sort(models.begin(), models.end(),
                   [](const GapModel& a, const GapModel& b) { return a.score > b.score; });
  return models;
}

double Search::p_value(const Eigen::MatrixXd& gap, const std::vector<Eigen::MatrixXd>& surrogates) const {
  const Eigen::VectorXd scale =
      (gap.colwise().squaredNorm().array() / double(gap.rows()) + 1e-18).rsqrt().transpose();
  const auto count = static_cast<Eigen::Index>(surrogates.size());
  // Column 0: the gap itself; then the surrogates.
  std::vector<Eigen::MatrixXd> signals;
  for (int j = 0; j < rows_.joints(); ++j) {
    Eigen::MatrixXd x(gap.rows(), count + 1);
    x.col(0) = scale[j] * gap.col(j);
    for (Eigen::Index k = 0; k < count; ++k)
      x.col(k + 1) = scale[j] * surrogates[static_cast<std::size_t>(k)].col(j);
    signals.push_back(std::move(x));
  }
  std::vector<const RowBlock*> blocks;
  for (const Grid& grid : grids_)
    for (const auto& unit : grid)
      for (const GridPoint& point : unit) blocks.push_back(point.block.get());
  Eigen::MatrixXd statistic(static_cast<Eigen::Index>(blocks.size()), count + 1);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
    const RowBlock& block = *blocks[b];
    const Eigen::Index p = block.size();
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(p, p), h = Eigen::MatrixXd::Zero(p, count + 1);
    for (std::size_t c = 0; c < block.channels.size(); ++c) {
      const auto j = static_cast<std::size_t>(block.channels[c]);
      const Eigen::MatrixXd columns = scale[block.channels[c]] * block.values[c];
      G.noalias() += columns.transpose() * columns;
      h.noalias() += columns.transpose() * signals[j];
    }
    G.diagonal().array() += 1e-9 * G.trace() / double(p) + 1e-300;
    Eigen::VectorXd explained = h.cwiseProduct(G.ldlt().solve(h)).colwise().sum().transpose();
    const double mean = explained.tail(count).mean();
    const double deviation = std::sqrt((explained.tail(count).array() - mean).square().mean()) + 1e-12;
    statistic.row(static_cast<Eigen::Index>(b)) = ((explained.array() - mean) / deviation).transpose();
  });
  const Eigen::VectorXd most = statistic.colwise().maxCoeff().transpose();
  return double(1 + (most.tail(count).array() >= most[0]).count()) / double(count + 1);
}

GapModel Search::best(double kappa, int most) const {
  GapModel model = none(kappa);
  while (static_cast<int>(model.effects.size()) < most) {
    const std::vector<GapModel> next = alternatives(model, 8);
    if (next.empty() || next[0].score < model.score + effect_gain) break;
    // In units of the noise: a further effect has to matter beside those before it.
    double before = 0.0, gained = 0.0;
    const GapModel start = none(kappa);
    for (int j = 0; j < rows_.joints(); ++j) {
      const double v = next[0].fit.residual.col(j).squaredNorm() / double(rows_.size()) + 1e-18;
      before += (start.fit.left.col(j).squaredNorm() - model.fit.left.col(j).squaredNorm()) / v;
      gained += (model.fit.left.col(j).squaredNorm() - next[0].fit.left.col(j).squaredNorm()) / v;
    }
    if (!model.effects.empty() && gained < least_part * (before + gained)) break;
    model = next[0];
    // Exchange: an earlier choice may have stood in for what is known only now.
    for (std::size_t k = 0; k + 1 < model.effects.size(); ++k) {
      std::vector<Adopted> others = model.effects;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const GapModel without = evaluate(others, kappa);
      const std::vector<GapModel> again = alternatives(without, 4);
      if (!again.empty() && again[0].score > model.score + 1e-6) model = again[0];
    }
  }
  // Backward.
  for (std::size_t k = model.effects.size(); k-- > 0 && model.effects.size() > 1;) {
    std::vector<Adopted> others = model.effects;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const GapModel without = evaluate(others, kappa);
    if (without.score > model.score - 0.5 * effect_gain) model = without;
  }
  return model;
}

}  // namespace dynid::detail
