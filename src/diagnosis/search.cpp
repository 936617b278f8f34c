// SPDX-License-Identifier: Apache-2.0
#include "search.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dynid::detail {
namespace {

constexpr double prior_weight = 4.0;  // rows are not as independent as the evidence takes them to be
constexpr double joint_gain = 6.0;    // log evidence that a further joint of an effect has to bring
constexpr double effect_gain = 10.0;  // and a further effect
// Of a joint's gap (energy) that a further effect has to explain: what is left of it is also what the forms
// of its effects are not exact in.
constexpr double least_part = 0.04, least_part_of_exact = 0.001;
constexpr double least_gain = 0.25;  // and of the energy of what is left of that joint's

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

/// What is usual besides start and duration, for a start.
Eigen::VectorXd window_shape(const Hypothesis& h, double from, double to) {
  const std::vector<ShapeParameter> parameters = h.shape();
  Eigen::VectorXd shape(static_cast<Eigen::Index>(parameters.size()));
  shape.head<2>() << from, to - from;
  for (std::size_t s = 2; s < parameters.size(); ++s) {
    const ShapeParameter& p = parameters[s];
    shape[static_cast<Eigen::Index>(s)] = p.logarithmic ? std::sqrt(p.low * p.high) : 0.5 * (p.low + p.high);
  }
  return shape;
}

/// All of the log: the usual shape, and each parameter that is linear at its end; the windows are scanned for
/// what all of them span.
std::vector<Eigen::VectorXd> window_points(const Hypothesis& h) {
  const std::vector<ShapeParameter> parameters = h.shape();
  std::vector<Eigen::VectorXd> points = {window_shape(h, -1e12, 1e12)};
  for (std::size_t s = 2; s < parameters.size(); ++s) {
    if (parameters[s].logarithmic) continue;
    points.push_back(points.front());
    points.back()[static_cast<Eigen::Index>(s)] = parameters[s].high;
  }
  return points;
}

/// A window's shape with its linear parameters at `place`, in parts of their highest values.
Eigen::VectorXd placed(const Hypothesis& h, Eigen::VectorXd shape, const Eigen::VectorXd& place) {
  const std::vector<ShapeParameter> parameters = h.shape();
  Eigen::Index k = 0;
  for (std::size_t s = 2; s < parameters.size(); ++s)
    if (!parameters[s].logarithmic) shape[static_cast<Eigen::Index>(s)] = place[k++] * parameters[s].high;
  return shape;
}

/// What coefficients c and a place s (-1 to 1 each) gain together, the columns being those of c and, for each
/// coordinate of the place, those of c again: (1, s) x c by turns. `normal`: their normal equations [G | h].
struct BilinearGain {
  double gain = 0.0;
  Eigen::VectorXd place;
};
BilinearGain bilinear_gain(const Eigen::MatrixXd& normal, Eigen::Index coefficients) {
  constexpr int turns = 40;
  const Eigen::Index p = normal.rows(), places = p / coefficients - 1;
  Eigen::MatrixXd G = normal.leftCols(p);
  G.diagonal().array() += 1e-9 * G.trace() + 1e-12;
  const Eigen::VectorXd h = normal.col(p);
  BilinearGain out{0.0, Eigen::VectorXd::Zero(places)};
  for (int k = 0; k < turns; ++k) {
    Eigen::MatrixXd by(p, coefficients);
    by.topRows(coefficients).setIdentity();
    for (Eigen::Index i = 0; i < places; ++i)
      by.middleRows((i + 1) * coefficients, coefficients) =
          out.place[i] * Eigen::MatrixXd::Identity(coefficients, coefficients);
    const Eigen::VectorXd c = (by.transpose() * G * by).ldlt().solve(by.transpose() * h);
    out.gain = 0.5 * c.dot(by.transpose() * h);
    if (places == 0) break;
    Eigen::VectorXd fixed = Eigen::VectorXd::Zero(p);
    fixed.head(coefficients) = c;
    Eigen::MatrixXd free = Eigen::MatrixXd::Zero(p, places);
    for (Eigen::Index i = 0; i < places; ++i) free.col(i).segment((i + 1) * coefficients, coefficients) = c;
    Eigen::MatrixXd A = free.transpose() * G * free;
    A.diagonal().array() += 1e-6 * A.trace() + 1e-12;  // along the force nothing tells the place
    out.place = A.ldlt().solve(free.transpose() * (h - G * fixed)).cwiseMax(-1.0).cwiseMin(1.0);
  }
  return out;
}

std::vector<Term> terms_of(const std::vector<Adopted>& effects) {
  std::vector<Term> terms;
  for (const Adopted& e : effects)
    for (const UnitShape& u : e.units) terms.push_back({u.block.get(), e.h});
  return terms;
}

/// The lower half of the band: binomial weights of nine rows, within each part.
Eigen::MatrixXd lower_half(const GapRows& rows, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd y = x;
  for (int pass = 0; pass < 4; ++pass) {
    const Eigen::MatrixXd before = y;
    for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
      const Eigen::Index first = rows.parts[p], last = rows.parts[p + 1] - 1;
      for (Eigen::Index i = first; i <= last; ++i)
        y.row(i) = 0.25 * before.row(std::max(first, i - 1)) + 0.5 * before.row(i) +
                   0.25 * before.row(std::min(last, i + 1));
    }
  }
  return y;
}

/// Rows in which no window of the effects acts; all, where they leave too few.
std::vector<Eigen::Index> outside_windows(const GapRows& rows, const std::vector<Adopted>& effects) {
  std::vector<Eigen::Index> out, all;
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    all.push_back(i);
    bool acts = false;
    for (const Adopted& e : effects)
      for (const UnitShape& u : e.units)
        for (std::size_t c = 0; e.h->scope() == Scope::window && c < u.block->channels.size(); ++c)
          acts = acts || !u.block->values[c].row(i).isZero(0.0);
    if (!acts) out.push_back(i);
  }
  return 4 * out.size() > all.size() ? out : all;
}

Eigen::MatrixXd beside(const Eigen::MatrixXd& left, const Eigen::MatrixXd& right) {
  Eigen::MatrixXd both(right.rows(), left.cols() + right.cols());
  both << left, right;
  return both;
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
    if (h.scope() == Scope::window) points = window_points(h);
    grids_[k].resize(static_cast<std::size_t>(h.units(rows.motions().front().robot())));
    for (std::size_t u = 0; u < grids_[k].size(); ++u) {
      for (const Eigen::VectorXd& p : points) {
        jobs.push_back({k, static_cast<int>(u), grids_[k][u].size()});
        grids_[k][u].push_back({p, nullptr});
      }
    }
  }
  // What a motion computes once for all is computed before it is shared.
  for (const GapMotion& motion : rows.motions()) {
    motion.force_columns(0, Eigen::Vector3d::Zero(), 0);
    motion.inertia(0);
  }
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t k) {
    GridPoint& point = grids_[jobs[k].h][static_cast<std::size_t>(jobs[k].unit)][jobs[k].point];
    point.block = std::make_shared<RowBlock>(rows_.block(*library_[jobs[k].h], jobs[k].unit, point.shape));
  });
}

double Search::cost(const Adopted& effect) const {
  // Each coefficient and each shape parameter by Schwarz, the choice of joints by its number of outcomes.
  double cost = -prior_weight * std::log(effect.h->prior());
  for (const UnitShape& unit : effect.units) cost += price(*effect.h, unit);
  if (effect.h->scope() == Scope::window) cost += 2.0 * std::log(double(rows_.size()));
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

double Search::price(const Hypothesis& h, const UnitShape& unit) const {
  const double coefficients = h.shape_only() ? 0.0 : double(unit.block->size());
  return (0.5 * std::log(double(rows_.size())) + 1.5) * (coefficients + double(unit.shape.size())) +
         (h.scope() == Scope::arm ? 0.0 : std::log(double(rows_.joints())));
}

Search::Channel Search::channel_of(const GapModel& model, int joint, bool keep_own) const {
  Channel out{model.fit.left.col(joint), Eigen::MatrixXd(rows_.size(), 0), 0.0, {}};
  Eigen::Index at = 0;
  for (const Adopted& e : model.effects) {
    for (const UnitShape& u : e.units) {
      const Eigen::Index p = e.h->shape_only() ? 0 : u.block->size();
      if (own_channel(*e.h, *u.block) && u.block->channels[0] == joint) {
        const Eigen::MatrixXd& values = u.block->values[0];
        if (p > 0) out.y += values * model.fit.theta.segment(at, p);
        if (p > 0 && keep_own) out.columns = beside(out.columns, values);
        if (p == 0 && !keep_own) out.y += values.rowwise().sum();
      }
      at += p;
    }
  }
  const ChannelFit fit = fit_channel(rows_, joint, out.y, out.columns, model.kappa);
  out.evidence = fit.evidence;
  out.by = {whitener(rows_, joint, white(out.y), model.kappa),
            whitener(rows_, joint, fit.noise, model.kappa)};
  return out;
}

Search::Base Search::base_of(const GapModel& model) const {
  const auto n = static_cast<std::size_t>(rows_.joints());
  Base base{model, std::vector<Channel>(n), {2, std::vector<Whitener>(n)}};
  tbb::parallel_for(0, rows_.joints(), [&](int j) {
    const auto at = static_cast<std::size_t>(j);
    base.channels[at] = channel_of(model, j, true);
    base.by[0][at] = whitener(rows_, j, white(rows_.y.col(j)), model.kappa);
    base.by[1][at] = whitener(rows_, j, model.fit.noise[at], model.kappa);
  });
  return base;
}

double Search::own_gain(const Hypothesis& h, const RowBlock& block, const Channel& channel,
                        double kappa) const {
  const int j = block.channels[0];
  if (h.shape_only())
    return fit_channel(rows_, j, channel.y - block.values[0].rowwise().sum(), channel.columns, kappa,
                       channel.by)
               .evidence -
           channel.evidence;
  return fit_channel(rows_, j, channel.y, beside(channel.columns, block.values[0]), kappa, channel.by)
             .evidence -
         channel.evidence;
}

double Search::coupled_gain(const Hypothesis& h, const RowBlock& block, const Base& base) const {
  std::vector<Term> terms = terms_of(base.model.effects);
  terms.push_back({&block, &h});
  return fit_terms(rows_, rows_.y, terms, base.model.kappa, base.by).total - base.model.fit.total;
}

double Search::improve(const Hypothesis& h, UnitShape& unit, Eigen::Index s, double low, double high,
                       bool logarithmic, double best, const Gain& gain) const {
  const auto to = [&](double x) { return logarithmic ? std::log(x) : x; };
  const Eigen::VectorXd shape = unit.shape;
  const auto value = [&](double x, UnitShape& out) {
    Eigen::VectorXd at = shape;
    at[s] = logarithmic ? std::exp(x) : x;
    out = made(h, unit.unit, at);
    return gain(*out.block);
  };
  low = to(low), high = to(high);
  const double g = 0.6180339887498949;  // golden section
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
  return best;
}

UnitShape Search::refined(const Hypothesis& h, UnitShape unit, const Gain& gain) const {
  const std::vector<ShapeParameter> shape = h.shape();
  if (shape.empty() || h.scope() == Scope::window) return unit;
  double best = gain(*unit.block);
  for (int pass = 0; pass < (shape.size() > 1 ? 2 : 1); ++pass) {
    for (Eigen::Index s = 0; s < unit.shape.size(); ++s) {
      const ShapeParameter& p = shape[static_cast<std::size_t>(s)];
      if (p.points < 3) continue;
      const double x = unit.shape[s];
      if (p.logarithmic) {
        const double step = std::pow(p.high / p.low, 1.0 / (p.points - 1));
        best = improve(h, unit, s, std::max(p.low, x / step), std::min(p.high, x * step), true, best, gain);
      } else {
        const double step = (p.high - p.low) / (p.points - 1);
        best = improve(h, unit, s, std::max(p.low, x - step), std::min(p.high, x + step), false, best, gain);
      }
    }
  }
  return unit;
}

UnitShape Search::best_shape(const Hypothesis& h, int unit, const std::vector<GridPoint>& points,
                             const Gain& gain, double worth) const {
  double best = -std::numeric_limits<double>::infinity();
  const GridPoint* point = &points.front();
  for (const GridPoint& p : points) {
    const double here = points.size() > 1 ? gain(*p.block) : 0.0;
    if (here > best) best = here, point = &p;
  }
  const UnitShape unit_shape{unit, point->shape, point->block};
  return points.size() > 1 && best < worth ? unit_shape : refined(h, unit_shape, gain);
}

Adopted Search::propose_own(const Hypothesis& h, const Grid& grid, const Base& base) const {
  Adopted effect{&h, {}, 0.0};
  const Robot& robot = rows_.motions().front().robot();
  for (std::size_t u = 0; u < grid.size(); ++u) {
    const Channel& channel = base.channels[u];
    const auto gain = [&](const RowBlock& block) { return own_gain(h, block, channel, base.model.kappa); };
    const UnitShape unit = best_shape(h, static_cast<int>(u), grid[u], gain);
    const double gained = gain(*unit.block) - price(h, unit);
    if (gained < joint_gain) continue;
    if (!h.shape_only()) {
      const ChannelFit fit = fit_channel(rows_, static_cast<int>(u), channel.y,
                                         beside(channel.columns, unit.block->values[0]), base.model.kappa);
      if (!h.plausible(robot, unit.unit, fit.theta.tail(unit.block->size()), unit.shape)) continue;
    }
    effect.units.push_back(unit);
    effect.gain += gained;
  }
  return effect;
}

Adopted Search::propose_coupled(const Hypothesis& h, const Grid& grid, const Base& base) const {
  Adopted effect{&h, {}, 0.0};
  const GapModel& model = base.model;
  const auto gain = [&](const RowBlock& block) { return coupled_gain(h, block, base); };
  std::vector<UnitShape> best(grid.size());
  std::vector<double> gains(grid.size());
  tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t u) {
    // What a joint does to itself chooses the shape: what it does to the others costs much to compute and
    // adds little.
    if (h.scope() == Scope::joint && grid[u].size() > 1)
      best[u] = best_shape(
          h, static_cast<int>(u), grid[u],
          [&](const RowBlock& block) {
            return own_gain(h, {{static_cast<int>(u)}, {*block.find(static_cast<int>(u))}}, base.channels[u],
                            model.kappa);
          },
          0.0);
    else
      best[u] = best_shape(h, static_cast<int>(u), grid[u], gain);
    const bool possible = !h.shape_only() || h.plausible(rows_.motions().front().robot(), static_cast<int>(u),
                                                         Eigen::VectorXd::Ones(1), best[u].shape);
    gains[u] = possible ? gain(*best[u].block) - price(h, best[u]) : -std::numeric_limits<double>::infinity();
  });
  if (gains.empty()) return effect;  // a pair, of a robot with one joint
  const auto first = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
  if (!std::isfinite(gains[first])) return effect;
  effect.units = {best[first]};
  effect.gain = gains[first];
  if (h.scope() == Scope::joint) {
    std::vector<bool> used(grid.size(), false);
    used[first] = true;
    const auto total = [&](const std::vector<UnitShape>& units) {
      std::vector<Term> terms = terms_of(model.effects);
      double sum = 0.0;
      for (const UnitShape& u : units) {
        terms.push_back({u.block.get(), &h});
        sum -= price(h, u);
      }
      return sum + fit_terms(rows_, rows_.y, terms, model.kappa, base.by).total - model.fit.total;
    };
    while (effect.units.size() < grid.size()) {
      double most = effect.gain + joint_gain;
      std::size_t next = grid.size();
      for (std::size_t u = 0; u < grid.size(); ++u) {
        if (used[u] || !std::isfinite(gains[u])) continue;
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
  for (bool plausible = h.shape_only(); !plausible && !effect.units.empty();) {
    std::vector<Term> terms = terms_of(model.effects);
    for (const UnitShape& u : effect.units) terms.push_back({u.block.get(), &h});
    const Fit fit = fit_terms(rows_, rows_.y, terms, model.kappa);
    Eigen::Index at = fit.theta.size() - effect.coefficients();
    plausible = true;
    std::vector<UnitShape> kept;
    for (const UnitShape& u : effect.units) {
      if (h.plausible(rows_.motions().front().robot(), u.unit, fit.theta.segment(at, u.block->size()),
                      u.shape))
        kept.push_back(u);
      else
        plausible = false;
      at += u.block->size();
    }
    effect.units = std::move(kept);
    if (!plausible && !effect.units.empty()) {
      std::vector<Term> fewer = terms_of(model.effects);
      for (const UnitShape& u : effect.units) fewer.push_back({u.block.get(), &h});
      effect.gain = fit_terms(rows_, rows_.y, fewer, model.kappa, base.by).total - model.fit.total;
      for (const UnitShape& u : effect.units) effect.gain -= price(h, u);
    }
  }
  return effect;
}

GapModel Search::reassigned(const GapModel& model) const {
  std::vector<std::size_t> own;  // of the model's effects
  for (std::size_t k = 0; k < model.effects.size(); ++k)
    if (own_channel(*model.effects[k].h, *model.effects[k].units.front().block)) own.push_back(k);
  if (own.size() < 2) return model;
  std::vector<Adopted> effects = model.effects;
  for (const std::size_t k : own) effects[k].units.clear();
  std::vector<std::vector<UnitShape>> decided(static_cast<std::size_t>(rows_.joints()));
  std::vector<std::vector<std::size_t>> whose(decided.size());
  for (int j = 0; j < rows_.joints(); ++j) {
    const Channel alone = channel_of(model, j, false);
    // Each effect as it stands on this joint; where it does not, in its best form by itself.
    std::vector<std::vector<UnitShape>> forms;
    bool any = false;
    for (const std::size_t k : own) {
      forms.emplace_back();
      for (const UnitShape& u : model.effects[k].units)
        if (u.unit == j) forms.back().push_back(u);
      any = any || !forms.back().empty();
    }
    if (!any) continue;
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (!forms[i].empty()) continue;
      const Hypothesis& h = *model.effects[own[i]].h;
      const auto found = std::find(library_.begin(), library_.end(), &h) - library_.begin();
      const auto& points = grids_[static_cast<std::size_t>(found)][static_cast<std::size_t>(j)];
      forms[i].push_back(
          best_shape(h, j, points, [&](const RowBlock& b) { return own_gain(h, b, alone, model.kappa); }));
    }
    double most = -std::numeric_limits<double>::infinity();
    const std::size_t subsets = std::size_t{1} << own.size();
    for (std::size_t subset = 0; subset < subsets; ++subset) {
      Eigen::VectorXd y = alone.y;
      Eigen::MatrixXd columns(rows_.size(), 0);
      double value = 0.0;
      std::vector<UnitShape> units;
      std::vector<std::size_t> owners;
      for (std::size_t i = 0; i < own.size(); ++i) {
        if ((subset >> i & 1U) == 0) continue;
        const Hypothesis& h = *model.effects[own[i]].h;
        const UnitShape& unit = forms[i].front();
        if (h.shape_only())
          y -= unit.block->values[0].rowwise().sum();
        else
          columns = beside(columns, unit.block->values[0]);
        value -= price(h, unit) + joint_gain;
        units.push_back(unit);
        owners.push_back(own[i]);
      }
      const ChannelFit fit = fit_channel(rows_, j, y, columns, model.kappa);
      Eigen::Index at = 0;
      bool plausible = true;
      for (std::size_t i = 0; i < units.size(); ++i) {
        const Hypothesis& h = *model.effects[owners[i]].h;
        const Eigen::Index p = h.shape_only() ? 0 : units[i].block->size();
        if (p > 0)
          plausible = plausible && h.plausible(rows_.motions().front().robot(), j, fit.theta.segment(at, p),
                                               units[i].shape);
        at += p;
      }
      value += fit.evidence;
      if (plausible && value > most) {
        most = value;
        decided[static_cast<std::size_t>(j)] = units;
        whose[static_cast<std::size_t>(j)] = owners;
      }
    }
  }
  for (std::size_t j = 0; j < decided.size(); ++j)
    for (std::size_t i = 0; i < decided[j].size(); ++i) effects[whose[j][i]].units.push_back(decided[j][i]);
  effects.erase(
      std::remove_if(effects.begin(), effects.end(), [](const Adopted& e) { return e.units.empty(); }),
      effects.end());
  if (effects.empty() || effects.back().h != model.effects.back().h) return model;  // the newest has to stay
  GapModel better = evaluate(std::move(effects), model.kappa);
  return better.score > model.score ? better : model;
}

Adopted Search::propose_window(const Hypothesis& h, const Grid& grid, const Base& beginning) const {
  const GapModel& base = beginning.model;
  // Scan: gain of a window for each link by prefix sums of its normal equations, rows taken as independent,
  // every column free; the links are then compared by what one point of each can do in its best window.
  const Eigen::Index size = rows_.size(), longest = size * 2 / 5;  // what lasts longer is no window
  double most = 0.0;
  int link = -1;
  Eigen::Index from = 0, to = 0;
  Eigen::VectorXd point;
  for (std::size_t u = 0; u < grid.size(); ++u) {
    RowBlock block = *grid[u][0].block;
    for (std::size_t k = 1; k < grid[u].size(); ++k)
      for (std::size_t c = 0; c < block.channels.size(); ++c)
        block.values[c] = beside(block.values[c], grid[u][k].block->values[c] - grid[u][0].block->values[c]);
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
    double here = 0.0;
    Eigen::Index begin = 0, end = 0;
    for (std::size_t part = 0; part + 1 < rows_.parts.size(); ++part) {
      const Eigen::Index first = rows_.parts[part], last = rows_.parts[part + 1];
      for (Eigen::Index length = 5; length <= std::min<Eigen::Index>(last - first, longest);
           length = std::max(length + 1, length * 5 / 4)) {
        for (Eigen::Index i = first; i + length <= last; i += std::max<Eigen::Index>(1, length / 12)) {
          const Eigen::MatrixXd d =
              sum[static_cast<std::size_t>(i + length)] - sum[static_cast<std::size_t>(i)];
          Eigen::MatrixXd G = d.leftCols(p);
          G.diagonal().array() += 1e-6 * G.trace() + 1e-12;
          const double gain = 0.5 * d.col(p).dot(G.llt().solve(d.col(p)));
          if (gain > here) here = gain, begin = i, end = i + length;
        }
      }
    }
    if (here <= most) continue;  // free columns do at least as much as those of a point
    const BilinearGain bilinear = bilinear_gain(
        sum[static_cast<std::size_t>(end)] - sum[static_cast<std::size_t>(begin)], grid[u][0].block->size());
    if (bilinear.gain > most)
      most = bilinear.gain, link = static_cast<int>(u), from = begin, to = end - 1, point = bilinear.place;
  }
  Adopted effect{&h, {}, 0.0};
  if (link < 0) return effect;
  const std::vector<ShapeParameter> shape = h.shape();
  const auto value = [&](const RowBlock& block) { return coupled_gain(h, block, beginning); };
  UnitShape best = made(h, link, placed(h, window_shape(h, rows_.stamp(from), rows_.stamp(to)), point));
  double gain = value(*best.block);
  const auto improve_all = [&](Eigen::Index first, double row) {
    for (Eigen::Index s = first; s < best.shape.size(); ++s) {
      const ShapeParameter& p = shape[static_cast<std::size_t>(s)];
      const bool edge = s < 2;
      gain = improve(h, best, s, edge ? best.shape[s] - row : p.low, edge ? best.shape[s] + row : p.high,
                     p.logarithmic, gain, value);
    }
  };
  for (int pass = 0; pass < 3; ++pass) improve_all(2, 0.0);
  // The ends, row by row, by what the full fit says.
  for (Eigen::Index step = std::max<Eigen::Index>(1, (to - from) / 8); step >= 1; step /= 2) {
    for (bool moved = true; moved;) {
      moved = false;
      for (const auto& [a, b] : {std::pair{from - step, to}, std::pair{from + step, to},
                                 std::pair{from, to - step}, std::pair{from, to + step}}) {
        if (a < 0 || b >= size || b - a < 4 || b - a >= longest ||
            rows_.log[static_cast<std::size_t>(a)] != rows_.log[static_cast<std::size_t>(b)])
          continue;
        Eigen::VectorXd at = best.shape;
        at.head<2>() << rows_.stamp(a), rows_.t[b] - rows_.t[a];
        const UnitShape other = made(h, link, at);
        const double here = value(*other.block);
        if (here > gain + 1e-6) {
          gain = here, best = other, from = a, to = b;
          moved = true;
          break;
        }
      }
    }
  }
  effect.units = {best};
  if (gain - cost(effect) > 0.0) {  // and between the rows
    const double row = (rows_.t[to] - rows_.t[from]) / double(to - from);
    for (int pass = 0; pass < 3; ++pass) improve_all(0, row);
    effect.units = {best};
  }
  effect.gain = gain - cost(effect);
  return effect;
}

Adopted Search::propose(const Hypothesis& h, const Grid& grid, const Base& base) const {
  if (h.scope() == Scope::window) return propose_window(h, grid, base);
  if (own_channel(h, *grid[0][0].block)) return propose_own(h, grid, base);
  return propose_coupled(h, grid, base);
}

std::vector<GapModel> Search::alternatives(const GapModel& base, std::size_t joint_refits) const {
  std::vector<Adopted> proposed(library_.size());
  const Base beginning = base_of(base);
  tbb::parallel_for(std::size_t{0}, library_.size(), [&](std::size_t k) {
    for (const Adopted& e : base.effects)
      if (e.h->name() == library_[k]->name())
        return;  // once each: another joint of it is a matter of the first choice
    proposed[k] = propose(*library_[k], grids_[k], beginning);
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
    models[k] = reassigned(evaluate(std::move(effects), base.kappa));
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
    signals.push_back(lower_half(rows_, x));
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
      const Eigen::MatrixXd columns = scale[block.channels[c]] * lower_half(rows_, block.values[c]);
      G.noalias() += columns.transpose() * columns;
      h.noalias() += columns.transpose() * signals[j];
    }
    G.diagonal().array() += 1e-9 * G.trace() / double(p) + 1e-300;
    Eigen::VectorXd explained = h.cwiseProduct(G.ldlt().solve(h)).colwise().sum().transpose();
    // The gap is one of them here: only then is it, without an effect, no more likely the largest than
    // another.
    const double mean = explained.mean();
    const double deviation = std::sqrt((explained.array() - mean).square().mean()) + 1e-12;
    statistic.row(static_cast<Eigen::Index>(b)) = ((explained.array() - mean) / deviation).transpose();
  });
  const Eigen::VectorXd most = statistic.colwise().maxCoeff().transpose();
  return double(1 + (most.tail(count).array() >= most[0]).count()) / double(count + 1);
}

std::vector<VisibleSize> Search::smallest_visible(const GapModel& none) const {
  std::vector<VisibleSize> out;
  const Base base = base_of(none);
  for (std::size_t k = 0; k < library_.size(); ++k) {
    const Hypothesis& h = *library_[k];
    const RowBlock& first = *grids_[k][0][0].block;
    if (h.shape_only() || h.once() || !own_channel(h, first) || first.size() != 1) continue;
    VisibleSize visible{h.name(), 0, 0.0};
    for (std::size_t u = 0; u < grids_[k].size(); ++u) {
      double least = std::numeric_limits<double>::infinity();
      for (const GridPoint& point : grids_[k][u]) {
        // Evidence grows by half of (coefficient / deviation)^2.
        const Eigen::MatrixXd& column = point.block->values[0];
        const double need = 2.0 * (price(h, {static_cast<int>(u), point.shape, point.block}) + effect_gain);
        const Eigen::MatrixXd seen = whitened(rows_, column, base.by[1][u].noise);
        const Eigen::MatrixXd hidden = base.by[1][u].nuisance.transpose() * seen;
        const double information =
            seen.squaredNorm() - (hidden.transpose() * base.by[1][u].llt.solve(hidden)).value();
        const double size = std::sqrt(column.squaredNorm() / double(rows_.size()) * need / information);
        if (information > 0.0 && size < least) least = size;
      }
      if (least > visible.torque_rms && std::isfinite(least))
        visible = {h.name(), static_cast<int>(u) + 1, least};
    }
    out.push_back(visible);
  }
  return out;
}

GapModel Search::exchanged(GapModel model) const {
  for (bool better = true; better;) {
    better = false;
    for (std::size_t k = 0; k < model.effects.size() && !better; ++k) {
      std::vector<Adopted> others = model.effects;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const std::vector<GapModel> again = alternatives(evaluate(std::move(others), model.kappa), 4);
      better = !again.empty() && again[0].score > model.score + 1e-3;
      if (better) model = again[0];
    }
  }
  return model;
}

GapModel Search::best(double kappa, int most) const {
  GapModel model = none(kappa);
  while (static_cast<int>(model.effects.size()) < most) {
    const std::vector<GapModel> next = alternatives(model, 8);
    if (next.empty() || next[0].score < model.score + effect_gain) break;
    // A further effect has to matter beside those before it, on one joint at least; beside a window, where
    // that is not.
    if (!model.effects.empty()) {
      const std::vector<Eigen::Index> where = outside_windows(rows_, model.effects);
      const auto energy = [&](const Eigen::MatrixXd& x) -> Eigen::RowVectorXd {
        return x(where, Eigen::all).colwise().squaredNorm();
      };
      Eigen::RowVectorXd part = Eigen::RowVectorXd::Constant(rows_.joints(), least_part_of_exact);
      for (const Adopted& e : model.effects)
        for (const UnitShape& u : e.units)
          if (e.h->approximate() && e.h->scope() != Scope::window)
            for (const int j : u.block->channels) part[j] = least_part;
      const Eigen::RowVectorXd gained = energy(model.fit.left) - energy(next[0].fit.left);
      const Eigen::RowVectorXd gap = energy(rows_.y), noise = energy(next[0].fit.residual);
      if ((gained.array() < part.array() * gap.array() || gained.array() < least_gain * noise.array()).all())
        break;
    }
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
  return exchanged(model);
}

}  // namespace dynid::detail
