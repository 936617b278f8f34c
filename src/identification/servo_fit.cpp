// SPDX-License-Identifier: Apache-2.0
#include "servo_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "dynid/base/statistics.hpp"
#include "dynid/identification/triangular_factor.hpp"
#include "dynid/signal/filter.hpp"
#include "servo_run.hpp"

namespace dynid::detail {
namespace {

/// The search's coordinates.
class Coordinates {
 public:
  Coordinates(const Parameters& free, const ServoProblem& problem) : free_(free) {
    for (const ServoParameter p : free) bounds_.push_back(servo_bounds(p, problem));
  }
  Eigen::Index size() const { return static_cast<Eigen::Index>(free_.size()); }
  const ServoBounds& bounds(Eigen::Index k) const { return bounds_[static_cast<std::size_t>(k)]; }
  Eigen::VectorXd of(const ServoJoint& joint) const {
    Eigen::VectorXd x(size());
    for (Eigen::Index k = 0; k < size(); ++k) {
      const ServoBounds& b = bounds(k);
      const double value = std::clamp(joint[free_[static_cast<std::size_t>(k)]], b.low, b.high);
      x[k] = b.logarithmic ? std::log(value) : value;
    }
    return x;
  }
  ServoJoint joint(ServoJoint joint, const Eigen::VectorXd& x) const {
    for (Eigen::Index k = 0; k < size(); ++k)
      joint[free_[static_cast<std::size_t>(k)]] =
          std::clamp(bounds(k).logarithmic ? std::exp(x[k]) : x[k], bounds(k).low, bounds(k).high);
    return joint;
  }
  double low(Eigen::Index k) const { return bounds(k).logarithmic ? std::log(bounds(k).low) : bounds(k).low; }
  double high(Eigen::Index k) const {
    return bounds(k).logarithmic ? std::log(bounds(k).high) : bounds(k).high;
  }
  /// d theta / d x.
  Eigen::VectorXd slope(const ServoJoint& joint) const {
    Eigen::VectorXd s(size());
    for (Eigen::Index k = 0; k < size(); ++k)
      s[k] = bounds(k).logarithmic ? joint[free_[static_cast<std::size_t>(k)]] : 1.0;
    return s;
  }

 private:
  const Parameters& free_;
  std::vector<ServoBounds> bounds_;
};

double cost_of(const ServoProblem& problem, const ServoJoint& joint, double width) {
  double cost = 0.0;
  Eigen::Index samples = 0;
  for (const ServoSeries* s : problem.series) {
    run_servo<false>(joint, *s, problem.substeps, [&](Eigen::Index i, const ServoState<false>& state) {
      cost += huber(s->q[i] - state.q, width);
    });
    samples += s->q.size();
  }
  return cost / double(samples);
}

/// Gradient and Gauss-Newton matrix of the loss a sample, in the search's coordinates.
struct Normal {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
  double cost = 0.0;
};

Normal normal_equations(const ServoProblem& problem, const ServoJoint& joint, const Parameters& free,
                        const Eigen::VectorXd& slope, double width) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Normal out{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), 0.0};
  Eigen::VectorXd J(n);
  Eigen::Index samples = 0;
  for (const ServoSeries* s : problem.series) {
    run_servo<true>(joint, *s, problem.substeps, [&](Eigen::Index i, const ServoState<true>& state) {
      const double r = s->q[i] - state.q;
      const double weight = std::abs(r) <= width ? 1.0 : width / std::abs(r);
      for (Eigen::Index k = 0; k < n; ++k)
        J[k] = slope[k] * state.dq[static_cast<int>(free[static_cast<std::size_t>(k)])];
      out.A.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
      out.b += weight * r * J;
      out.cost += huber(r, width);
    });
    samples += s->q.size();
  }
  out.A = Eigen::MatrixXd(out.A.selfadjointView<Eigen::Lower>()) / double(samples);
  out.b /= double(samples);
  out.cost /= double(samples);
  return out;
}

}  // namespace

ServoBounds servo_bounds(ServoParameter p, const ServoProblem& problem) {
  const double interval = problem.series.front()->interval;
  const double infinite = 1e6;
  switch (p) {
    case ServoParameter::inertia:  // a natural frequency above twice the sampling rate's Nyquist cannot be
                                   // seen
      return {true, interval * interval / (4.0 * M_PI * M_PI), 1e4 * interval * interval};
    case ServoParameter::damping:
      return {true, 1e-3 * interval, 1e3 * interval};
    case ServoParameter::coulomb:
    case ServoParameter::stribeck:
    case ServoParameter::compliance:
      return {false, 0.0, infinite};
    case ServoParameter::bias:
      return {false, -infinite, infinite};
    case ServoParameter::delay:
      return {false, problem.earliest_delay * interval, problem.longest_delay * interval};
    case ServoParameter::stribeck_velocity:
      return {true, 1e-6, infinite};
    case ServoParameter::load_friction:  // of one: a gear that locks itself under load
      return {false, 0.0, 1.0};
    case ServoParameter::limit:
      return {true, 1e-9, infinite};
    case ServoParameter::command_lag:
      return {false, 0.0, 10.0 * problem.longest_delay * interval};
    case ServoParameter::backlash:
      return {false, 0.0, infinite};
    case ServoParameter::gravity_compensation:  // none of it to half as much again
      return {false, 0.0, 1.5};
    case ServoParameter::spring:  // it holds the joint's own place at least
      return {false, -0.9, infinite};
  }
  return {};
}

Eigen::VectorXd simulate_servo(const ServoJoint& joint, const ServoSeries& series, int substeps) {
  Eigen::VectorXd q(series.q.size());
  q[0] = series.q[0];
  run_servo<false>(joint, series, substeps,
                   [&](Eigen::Index i, const ServoState<false>& state) { q[i] = state.q; });
  return q;
}

Eigen::VectorXd servo_errors(const ServoJoint& joint, const ServoProblem& problem) {
  Eigen::VectorXd errors(static_cast<Eigen::Index>(problem.series.size()));
  for (std::size_t k = 0; k < problem.series.size(); ++k) {
    const ServoSeries& s = *problem.series[k];
    errors[static_cast<Eigen::Index>(k)] =
        (simulate_servo(joint, s, problem.substeps) - s.q).cwiseAbs().mean();
  }
  return errors;
}

double huber_width(const ServoProblem& problem, const ServoJoint& joint) {
  std::vector<double> r;
  double step = 0.0;
  for (const ServoSeries* s : problem.series) {
    const Eigen::VectorXd q = simulate_servo(joint, *s, problem.substeps);
    for (Eigen::Index i = 0; i < q.size(); ++i) r.push_back(std::abs(q[i] - s->q[i]));
    step = std::max(step, s->resolution);
  }
  return std::max({huber_constant * deviations_to_sigma * median(std::move(r)), step, 1e-12});
}

ServoSolution fit_servo(const ServoProblem& problem, const ServoJoint& start, const Parameters& free,
                        double width, int iterations) {
  constexpr double converged = 1e-6;    // of the loss, relative
  constexpr double longest_step = 1.0;  // of a logarithm: a factor e
  const Coordinates coordinates(free, problem);
  const Eigen::Index n = coordinates.size();
  Eigen::VectorXd x = coordinates.of(start);
  ServoSolution out;
  out.width = width;
  out.joint = coordinates.joint(start, x);
  double damping = 1e-3;
  bool moved = true;
  for (; out.iterations < iterations && moved; ++out.iterations) {
    const Normal normal = normal_equations(problem, out.joint, free, coordinates.slope(out.joint), width);
    out.cost = normal.cost;
    moved = false;
    for (int attempt = 0; attempt < 8 && !moved; ++attempt) {
      Eigen::MatrixXd A = normal.A;
      Eigen::VectorXd b = normal.b;
      A.diagonal() *= 1.0 + damping;
      A.diagonal().array() += 1e-14 * std::max(A.diagonal().maxCoeff(), 1e-300);
      for (Eigen::Index k = 0; k < n; ++k) {  // at a bound and pushed outwards: held there
        if ((x[k] <= coordinates.low(k) && b[k] <= 0.0) || (x[k] >= coordinates.high(k) && b[k] >= 0.0)) {
          A.row(k).setZero();
          A.col(k).setZero();
          A(k, k) = 1.0;
          b[k] = 0.0;
        }
      }
      Eigen::VectorXd next = x + A.ldlt().solve(b);
      for (Eigen::Index k = 0; k < n; ++k) {
        if (coordinates.bounds(k).logarithmic)
          next[k] = std::clamp(next[k], x[k] - longest_step, x[k] + longest_step);
        next[k] = std::clamp(next[k], coordinates.low(k), coordinates.high(k));
      }
      const ServoJoint candidate = coordinates.joint(start, next);
      const double cost = next.allFinite() ? cost_of(problem, candidate, width) : out.cost;
      if (cost < out.cost) {
        moved = out.cost - cost > converged * out.cost;
        x = next;
        out.joint = candidate;
        out.cost = cost;
        damping = std::max(damping / 5.0, 1e-9);
        if (!moved) return out;
      } else {
        damping *= 5.0;
      }
    }
  }
  return out;
}

std::optional<ServoJoint> equation_error(const ServoProblem& problem) {
  // a ddq + c dq + f sgn dq + b = u(t - d) - q, rows of a joint that moves; all columns behind one filter.
  struct Rows {
    Eigen::MatrixXd columns;  // ddq, dq, sgn dq, 1
    Eigen::VectorXd q, grid;
    double rate;
  };
  std::vector<Rows> rows;
  for (const ServoSeries* s : problem.series) {
    std::vector<Eigen::Index> fresh = {0};
    for (Eigen::Index i = 1; i < s->t.size(); ++i)
      if (s->t[i] > s->t[fresh.back()]) fresh.push_back(i);
    const auto n = static_cast<Eigen::Index>(fresh.size());
    Eigen::VectorXd t(n), q(n);
    for (Eigen::Index i = 0; i < n; ++i)
      t[i] = s->t[fresh[static_cast<std::size_t>(i)]], q[i] = s->q[fresh[static_cast<std::size_t>(i)]];
    const double rate = 1.0 / s->interval;
    const auto count = static_cast<Eigen::Index>((t[n - 1] - t[0]) * rate) + 1;
    if (count < 64) continue;
    Rows r;
    r.rate = rate;
    r.grid = Eigen::VectorXd::LinSpaced(count, t[0], t[0] + double(count - 1) / rate);
    Eigen::MatrixXd x = interpolate(t, q, r.grid);
    ZeroPhaseButterworth(rate / 6.0, rate).apply(x);
    const Eigen::MatrixXd v = differentiate(x, rate), a = differentiate(v, rate);
    r.q = x;
    r.columns.resize(count, 4);
    r.columns << a, v, v.cwiseSign(), Eigen::VectorXd::Ones(count);
    rows.push_back(std::move(r));
  }
  if (rows.empty()) return {};
  double speed = 0.0;
  for (const Rows& r : rows)
    speed = std::max(speed, std::sqrt(r.columns.col(1).squaredNorm() / double(r.q.size())));
  const double interval = problem.series.front()->interval;
  double best = std::numeric_limits<double>::infinity();
  std::optional<ServoJoint> found;
  for (int quarter = 0; quarter <= 4 * problem.longest_delay; ++quarter) {
    const double delay = 0.25 * quarter * interval;
    TriangularFactor factor(4);
    std::size_t k = 0;
    for (const ServoSeries* s : problem.series) {
      if (k >= rows.size()) break;
      const Rows& r = rows[k++];
      Eigen::MatrixXd u(r.grid.size(), 1);
      Eigen::Index hint = 0;
      ServoInput in;
      for (Eigen::Index i = 0; i < r.grid.size(); ++i) {
        s->command.fill(r.grid[i] - 0.5 * interval, interval, delay, hint, in);
        u(i, 0) = in.command;
      }
      ZeroPhaseButterworth(r.rate / 6.0, r.rate).apply(u);
      Eigen::MatrixXd block(r.grid.size(), 5);
      Eigen::Index used = 0;
      for (Eigen::Index i = 0; i < r.grid.size(); ++i) {
        if (std::abs(r.columns(i, 1)) < 0.2 * speed) continue;  // a joint at rest does not say its friction
        block.row(used) << r.columns.row(i), u(i, 0) - r.q[i];
        ++used;
      }
      factor.add(block.topRows(used));
    }
    if (factor.rows() < 64) return {};
    if (factor.residual() >= best) continue;
    const Eigen::VectorXd x = factor.R().colPivHouseholderQr().solve(factor.z());
    if (!x.allFinite() || x[0] <= 0.0 || x[1] <= 0.0) continue;
    best = factor.residual();
    ServoJoint joint;
    joint.inertia = x[0];
    joint.damping = x[1];
    joint.coulomb = std::max(x[2], 0.0);
    joint.bias = x[3];
    joint.delay = delay;
    found = joint;
  }
  return found;
}

namespace {

/// Widens a covariance by how the parameters move when one log after the other is left out (the
/// delete-one-group jackknife, in one step each): a model that is not the robot's to the last fits each
/// motion with other numbers. The scores of the logs by themselves say less than that, since each log draws
/// the fit to itself: intervals by them held the estimate of other motions of a real arm in half of the
/// cases. Each parameter by its own spread, or by the geometric mean of all, which few logs say better. What
/// the spread has beyond the covariance counts twice: there is no true number then but what as many other
/// motions give, and these scatter as much.
/// Returns the degrees of freedom of the sum (Satterthwaite 1946), `degrees` being those of `covariance`.
double widen_to_logs(const Eigen::MatrixXd& hessian, const std::vector<Eigen::MatrixXd>& of_logs,
                     const std::vector<Eigen::VectorXd>& scores, double degrees,
                     Eigen::MatrixXd& covariance) {
  const Eigen::Index n = hessian.rows();
  const auto count = static_cast<Eigen::Index>(scores.size());
  Eigen::MatrixXd moved(n, count);
  for (Eigen::Index l = 0; l < count; ++l) {
    const auto k = static_cast<std::size_t>(l);
    Eigen::MatrixXd rest = hessian - of_logs[k];
    rest.diagonal() += 1e-9 * hessian.diagonal();  // a log alone may show a parameter
    moved.col(l) = rest.ldlt().solve(scores[k]);
  }
  const Eigen::VectorXd spread = (moved.colwise() - moved.rowwise().mean()).rowwise().squaredNorm() *
                                 (double(count - 1) / double(count));
  Eigen::VectorXd ratio = Eigen::VectorXd::Ones(n);
  double logarithms = 0.0;
  Eigen::Index seen = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!(covariance(k, k) > 0.0 && spread[k] > 0.0)) continue;
    ratio[k] = spread[k] / covariance(k, k);
    logarithms += std::log(ratio[k]);
    ++seen;
  }
  if (seen == 0) return degrees;
  const double usual = std::max(1.0, std::exp(logarithms / double(seen)));
  const Eigen::VectorXd scale = (2.0 * ratio.cwiseMax(usual).array() - 1.0).sqrt();
  covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
  const double excess = 2.0 * (usual - 1.0), sum = 1.0 + excess;
  return sum * sum / (1.0 / degrees + excess * excess / double(count - 1));
}

}  // namespace

ServoInformation servo_information(const ServoProblem& problem, const ServoSolution& solution,
                                   const Parameters& free) {
  constexpr Eigen::Index blocks_a_log = 20;
  ServoInformation out;
  out.free = free;
  const auto n = static_cast<Eigen::Index>(out.free.size());
  const Coordinates coordinates(out.free, problem);
  const Eigen::VectorXd slope = coordinates.slope(solution.joint);
  out.hessian = Eigen::MatrixXd::Zero(n, n);
  std::vector<Eigen::VectorXd> blocks, logs;
  std::vector<Eigen::MatrixXd> hessians;  // of each log
  for (const ServoSeries* s : problem.series) {
    const Eigen::Index size = s->q.size(),
                       length = std::max<Eigen::Index>(1, (size + blocks_a_log - 1) / blocks_a_log);
    Eigen::VectorXd score = Eigen::VectorXd::Zero(n), of_log = score, J(n);
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(n, n);
    Eigen::Index filled = 0;
    run_servo<true>(solution.joint, *s, problem.substeps, [&](Eigen::Index i, const ServoState<true>& state) {
      const double r = s->q[i] - state.q;
      const bool inside = std::abs(r) <= solution.width;
      for (Eigen::Index k = 0; k < n; ++k)
        J[k] = slope[k] * state.dq[static_cast<int>(out.free[static_cast<std::size_t>(k)])];
      if (inside) hessian.noalias() += J * J.transpose();
      score += (inside ? r : std::copysign(solution.width, r)) * J;
      if (++filled == length || i + 1 == size) {
        blocks.push_back(score);
        of_log += score;
        score.setZero();
        filled = 0;
      }
    });
    logs.push_back(of_log);
    hessians.emplace_back(hessian.selfadjointView<Eigen::Lower>());
    out.hessian += hessians.back();
  }
  Eigen::MatrixXd H = out.hessian;
  for (Eigen::Index k = 0; k < n; ++k) {
    out.visible.push_back(H(k, k) > 0.0);
    if (!out.visible.back()) H(k, k) = 1.0;
  }
  H.diagonal() *= 1.0 + 1e-9;
  const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  for (const Eigen::VectorXd& s : blocks) mean += s / double(blocks.size());
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::VectorXd& s : blocks) S += (s - mean) * (s - mean).transpose();
  out.covariance = inverse * S * inverse * (double(blocks.size()) / double(blocks.size() - 1));
  out.degrees = double(blocks.size()) - double(n);
  if (logs.size() >= 3) out.degrees = widen_to_logs(H, hessians, logs, out.degrees, out.covariance);
  return out;
}

}  // namespace dynid::detail
