// SPDX-License-Identifier: Apache-2.0
// An effect in a window of time: the windows of each link are scanned by prefix sums, the links compared by
// what one point of each can do in its best window, and the best is refined by full fits.
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "propose.hpp"

namespace dynid::detail {
namespace {

/// What is usual besides start and duration, for a start.
Eigen::VectorXd window_shape(const std::vector<ShapeParameter>& parameters, double from, double to) {
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
std::vector<Eigen::VectorXd> window_points(const std::vector<ShapeParameter>& parameters) {
  std::vector<Eigen::VectorXd> points = {window_shape(parameters, -1e12, 1e12)};
  for (std::size_t s = 2; s < parameters.size(); ++s) {
    if (parameters[s].logarithmic) continue;
    points.push_back(points.front());
    points.back()[static_cast<Eigen::Index>(s)] = parameters[s].high;
  }
  return points;
}

/// A window's shape with its linear parameters at `place`, in parts of their highest values.
Eigen::VectorXd placed(const std::vector<ShapeParameter>& parameters, Eigen::VectorXd shape,
                       const Eigen::VectorXd& place) {
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
  if (coefficients < 1) return {};
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

/// A window and a place in it, as the scan leaves them.
struct Scanned {
  double gain = 0.0;
  int link = -1;
  Eigen::Index from = 0, to = 0;  // rows, both included
  Eigen::VectorXd place;
};

/// The columns of a link's grid side by side: those of the usual shape, then what each linear shape parameter
/// adds.
RowBlock spanned(const std::vector<GridPoint>& points) {
  RowBlock block = *points[0].block;
  for (std::size_t k = 1; k < points.size(); ++k)
    for (std::size_t c = 0; c < block.channels.size(); ++c)
      block.values[c] = beside(block.values[c], points[k].block->values[c] - points[0].block->values[c]);
  return block;
}

/// Prefix sums of the normal equations [G | h], rows taken as independent: of each row, those before it.
std::vector<Eigen::MatrixXd> prefix_sums(const RowBlock& block, const GapModel& model) {
  const Eigen::Index size = model.fit.left.rows(), p = block.size();
  std::vector<Eigen::MatrixXd> sum(static_cast<std::size_t>(size) + 1, Eigen::MatrixXd::Zero(p, p + 1));
  for (Eigen::Index i = 0; i < size; ++i) {
    Eigen::MatrixXd& next = sum[static_cast<std::size_t>(i) + 1];
    next = sum[static_cast<std::size_t>(i)];
    for (std::size_t c = 0; c < block.channels.size(); ++c) {
      const int j = block.channels[c];
      const Eigen::VectorXd row = block.values[c].row(i).transpose();
      const double w = 1.0 / model.fit.noise[static_cast<std::size_t>(j)].variance;
      next.leftCols(p) += w * row * row.transpose();
      next.col(p) += w * model.fit.left(i, j) * row;
    }
  }
  return sum;
}

/// Half of the gap's energy in units of the noise, on the joints that a block acts on: of each row, that of
/// those before it. No window gains more.
std::vector<double> most_gained(const RowBlock& block, const GapModel& model) {
  std::vector<double> sum = {0.0};
  for (Eigen::Index i = 0; i < model.fit.left.rows(); ++i) {
    double here = 0.0;
    for (const int j : block.channels)
      here +=
          model.fit.left(i, j) * model.fit.left(i, j) / model.fit.noise[static_cast<std::size_t>(j)].variance;
    sum.push_back(sum.back() + 0.5 * here);
  }
  return sum;
}

/// The best window of free columns that gains more than `least`, and what one point does in it.
Scanned scan(const GapRows& rows, const std::vector<Eigen::MatrixXd>& sum, const std::vector<double>& most,
             Eigen::Index coefficients, Eigen::Index longest, double least) {
  const Eigen::Index p = sum.front().rows();
  double here = least;
  Eigen::Index begin = 0, end = 0;
  // A window goes on across what is kept to judge: a log's rows are a stretch, whatever their parts.
  for (Eigen::Index first = 0, last = 0; first < rows.size(); first = last) {
    while (last < rows.size() &&
           rows.log[static_cast<std::size_t>(last)] == rows.log[static_cast<std::size_t>(first)])
      ++last;
    for (Eigen::Index length = 5; length <= std::min<Eigen::Index>(last - first, longest);
         length = std::max(length + 1, length * 5 / 4)) {
      for (Eigen::Index i = first; i + length <= last; i += std::max<Eigen::Index>(1, length / 12)) {
        if (most[static_cast<std::size_t>(i + length)] - most[static_cast<std::size_t>(i)] <= here) continue;
        const Eigen::MatrixXd d =
            sum[static_cast<std::size_t>(i + length)] - sum[static_cast<std::size_t>(i)];
        Eigen::MatrixXd G = d.leftCols(p);
        G.diagonal().array() += 1e-6 * G.trace() + 1e-12;
        const double gain = 0.5 * d.col(p).dot(G.llt().solve(d.col(p)));
        if (gain > here) here = gain, begin = i, end = i + length;
      }
    }
  }
  if (end == 0) return {};  // free columns do at least as much as those of a point
  const BilinearGain bilinear =
      bilinear_gain(sum[static_cast<std::size_t>(end)] - sum[static_cast<std::size_t>(begin)], coefficients);
  return {bilinear.gain, 0, begin, end - 1, bilinear.place};
}

/// Refines a scanned window by what the full fit says.
class WindowFit {
 public:
  WindowFit(const Evaluator& by, const Hypothesis& h, const Base& base, const Scanned& found,
            Eigen::Index longest)
      : by_(by),
        h_(h),
        base_(base),
        parameters_(by.rows.shape(h, found.link)),
        from_(found.from),
        to_(found.to),
        longest_(longest) {
    const GapRows& rows = by.rows;
    const Eigen::VectorXd usual = window_shape(parameters_, rows.stamp(from_), rows.stamp(to_));
    best_ = by.made(h, found.link, placed(parameters_, usual, found.place));
    gain_ = value(*best_.block);
  }

  /// All from `first` on, by turns, as long as a turn brings something.
  void improve_until(Eigen::Index first, double row) {
    constexpr int most_turns = 3;
    for (int turn = 0; turn < most_turns; ++turn) {
      const double before = gain_;
      improve_all(first, row);
      if (gain_ - before < enough) break;
    }
  }

  /// Shape parameters from `first` on: a window's ends within `row` [s], the others in their ranges; those
  /// that are linear all at once.
  void improve_all(Eigen::Index first, double row) {
    put_in_place();
    for (Eigen::Index s = first; s < best_.shape.size(); ++s) {
      const ShapeParameter& p = parameters_[static_cast<std::size_t>(s)];
      const bool edge = s < 2;
      if (!edge && !p.logarithmic) continue;
      gain_ = improve(by_, h_, best_, s, edge ? best_.shape[s] - row : p.low,
                      edge ? best_.shape[s] + row : p.high, p.logarithmic, gain_,
                      [this](const RowBlock& block) { return value(block); });
    }
  }

  /// The ends, row by row.
  void move_ends() {
    for (Eigen::Index step = std::max<Eigen::Index>(1, (to_ - from_) / 8); step >= 1; step /= 2)
      while (moved(step)) {
      }
  }

  double row() const { return (by_.rows.t[to_] - by_.rows.t[from_]) / double(to_ - from_); }
  const UnitShape& best() const { return best_; }
  double gain() const { return gain_; }

 private:
  static constexpr double enough = 0.1;  // nats: no judgement hangs on less
  double value(const RowBlock& block) const { return by_.coupled_gain(h_, block, base_); }

  /// The linear shape parameters in the window as it is, by the normal equations of all that they span.
  void put_in_place() {
    std::vector<GridPoint> points;
    const auto add = [&](const Eigen::VectorXd& shape) {
      const UnitShape unit = by_.made(h_, best_.unit, shape);
      points.push_back({unit.shape, unit.block});
    };
    const Eigen::VectorXd nowhere = placed(
        parameters_, best_.shape, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(parameters_.size())));
    add(nowhere);
    for (std::size_t s = 2; s < parameters_.size(); ++s) {
      if (parameters_[s].logarithmic) continue;
      Eigen::VectorXd shape = nowhere;
      shape[static_cast<Eigen::Index>(s)] = parameters_[s].high;
      add(shape);
    }
    if (points.size() < 2) return;
    for (const Eigen::MatrixXd& normal : normal_equations_beside(by_.rows, base_.terms, spanned(points))) {
      const UnitShape unit =
          by_.made(h_, best_.unit,
                   placed(parameters_, best_.shape, bilinear_gain(normal, points[0].block->size()).place));
      const double here = value(*unit.block);
      if (here > gain_) gain_ = here, best_ = unit;
    }
  }

  bool moved(Eigen::Index step) {
    const GapRows& rows = by_.rows;
    for (const auto& [a, b] : {std::pair{from_ - step, to_}, std::pair{from_ + step, to_},
                               std::pair{from_, to_ - step}, std::pair{from_, to_ + step}}) {
      if (a < 0 || b >= rows.size() || b - a < 4 || b - a >= longest_ ||
          rows.log[static_cast<std::size_t>(a)] != rows.log[static_cast<std::size_t>(b)])
        continue;
      Eigen::VectorXd at = best_.shape;
      at.head<2>() << rows.stamp(a), rows.t[b] - rows.t[a];
      const UnitShape other = by_.made(h_, best_.unit, at);
      const double here = value(*other.block);
      if (here > gain_ + 1e-6) {
        gain_ = here, best_ = other, from_ = a, to_ = b;
        return true;
      }
    }
    return false;
  }

  const Evaluator& by_;
  const Hypothesis& h_;
  const Base& base_;
  std::vector<ShapeParameter> parameters_;
  Eigen::Index from_, to_, longest_;
  UnitShape best_;
  double gain_ = 0.0;
};

}  // namespace

std::vector<Eigen::VectorXd> grid_points(const GapRows& rows, const Hypothesis& h, int unit) {
  const std::vector<ShapeParameter> shape = rows.shape(h, unit);
  if (h.scope() == Scope::window) return window_points(shape);
  std::vector<Eigen::VectorXd> points = {Eigen::VectorXd(0)};
  for (const ShapeParameter& s : shape) {
    std::vector<Eigen::VectorXd> next;
    for (const Eigen::VectorXd& p : points) {
      for (int k = 0; k < s.points; ++k) {
        const double part = s.points > 1 ? double(k) / (s.points - 1) : 0.0;
        Eigen::VectorXd q(p.size() + 1);
        q << p, s.at(part);
        next.push_back(q);
      }
    }
    points = next;
  }
  return points;
}

Adopted propose_window(const Evaluator& by, const Hypothesis& h, const Grid& grid, const Base& base,
                       double worth) {
  const Eigen::Index longest = by.rows.size() * 2 / 5;  // what lasts longer is no window
  std::vector<Scanned> by_link(grid.size());
  tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t u) {
    const RowBlock block = spanned(grid[u].points);
    by_link[u] = scan(by.rows, prefix_sums(block, base.model), most_gained(block, base.model),
                      grid[u].points[0].block->size(), longest, worth);
    by_link[u].link = static_cast<int>(u);
  });
  Scanned found;
  for (const Scanned& here : by_link)
    if (here.gain > found.gain) found = here;
  Adopted effect{&h, {}, 0.0};
  // The scan takes rows as independent, and so gains more than the fit will.
  if (found.link < 0 || found.gain < worth) return effect;
  WindowFit fit(by, h, base, found, longest);
  fit.improve_until(2, 0.0);
  effect.units = {fit.best()};
  // Its ends, as they are scanned, are within a tenth of its length: they do not double what it gains.
  if (2.0 * fit.gain() - by.cost(effect) < worth) return {&h, {}, 0.0};
  fit.move_ends();
  effect.units = {fit.best()};
  if (fit.gain() - by.cost(effect) > 0.0) {  // and between the rows
    fit.improve_until(0, fit.row());
    effect.units = {fit.best()};
  }
  effect.gain = fit.gain() - by.cost(effect);
  return effect;
}

}  // namespace dynid::detail
