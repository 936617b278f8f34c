// SPDX-License-Identifier: Apache-2.0
#include "servo_joint_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "dynid/base/statistics.hpp"
#include "identification/servo_run.hpp"

namespace dynid::detail {
namespace {

bool counts(const ServoRows& rows, Eigen::Index i, RowSet set) {
  const auto k = static_cast<std::size_t>(i);
  if (!rows.fit[k]) return false;
  return set == RowSet::fit || (rows.half[k] == 0) == (set == RowSet::first_half);
}

/// The rigid body may be off part by part, not as a whole.
bool in_parts(const ServoProblemOfJoint& p) {
  return !p.rows.empty() && p.rows.front().series.parts.rows() > 0;
}

template <bool sensitive, class Visit>
void run_knobs(const ServoJoint& joint, const ServoRows& rows, const ServoProblemOfJoint& p, const Knobs& x,
               Visit&& visit) {
  run_servo<sensitive, servo_load_parts>(joint, rows.series, p.substeps, visit, &x[at(Knob::load_part)]);
}

/// The knobs that a fit turns, in the coordinates of the search.
class Turned {
 public:
  Turned(const ServoProblemOfJoint& p, const std::vector<Knob>& free) : p_(p) {
    for (const Knob k : free) add(k, true);
    for (const Knob k : {Knob::kp, Knob::inertia, Knob::damping, Knob::coulomb, Knob::delay, Knob::stribeck,
                         Knob::load_friction, Knob::load_gain, Knob::limit, Knob::lag, Knob::backlash}) {
      const double value = p.nominal[at(k)];
      if (p.tolerance <= 0.0 || value == 0.0 || !std::isfinite(value) ||
          std::count(free.begin(), free.end(), k) > 0)
        continue;
      if (k == Knob::kp && !(p.nominal[at(Knob::load_gain)] > 0.0)) continue;  // the ratios say it all
      if (k == Knob::load_gain && in_parts(p)) continue;
      add(k, false);
    }
    if (in_parts(p))
      for (int k = 0; k < servo_load_parts; ++k) add(load_part(k), false);
  }
  Eigen::Index size() const { return static_cast<Eigen::Index>(knobs_.size()); }
  Knob knob(Eigen::Index k) const { return knobs_[static_cast<std::size_t>(k)]; }
  bool free(Eigen::Index k) const { return free_[static_cast<std::size_t>(k)]; }
  const KnobRange& range(Eigen::Index k) const { return ranges_[static_cast<std::size_t>(k)]; }
  double low(Eigen::Index k) const { return coordinate(k, range(k).low); }
  double high(Eigen::Index k) const { return coordinate(k, range(k).high); }
  double coordinate(Eigen::Index k, double value) const {
    return range(k).logarithmic ? std::log(value) : value;
  }
  Eigen::VectorXd of(const Knobs& x) const {
    Eigen::VectorXd y(size());
    for (Eigen::Index k = 0; k < size(); ++k)
      y[k] = coordinate(k, std::clamp(x[at(knob(k))], range(k).low, range(k).high));
    return y;
  }
  Knobs knobs(Knobs x, const Eigen::VectorXd& y) const {
    for (Eigen::Index k = 0; k < size(); ++k)
      x[at(knob(k))] = std::clamp(range(k).logarithmic ? std::exp(y[k]) : y[k], range(k).low, range(k).high);
    return x;
  }
  /// d knob / d coordinate.
  double slope(Eigen::Index k, const Knobs& x) const { return range(k).logarithmic ? x[at(knob(k))] : 1.0; }
  /// Standard deviation of a nominal parameter, in its coordinate.
  double sigma(Eigen::Index k) const {
    return range(k).logarithmic ? p_.tolerance : nominal_deviation(p_, knob(k));
  }
  double penalty(const Eigen::VectorXd& y) const {
    double sum = 0.0;
    for (Eigen::Index k = 0; k < size(); ++k)
      if (!free(k)) {
        const double z = (y[k] - coordinate(k, p_.nominal[at(knob(k))])) / sigma(k);
        sum += 0.5 * z * z;
      }
    return sum;
  }

 private:
  void add(Knob k, bool free) {
    KnobRange range = range_of(k, p_.nominal, p_.scale);
    if (!free && !is_load_part(k)) {  // wherever the nominal value lies
      const double value = p_.nominal[at(k)], room = 10.0 * p_.tolerance * std::abs(value);
      range.logarithmic = false;
      range.low = value - room, range.high = value + room;
      if (value > 0.0) range.low = std::max(range.low, 1e-3 * value);
    }
    knobs_.push_back(k);
    free_.push_back(free);
    ranges_.push_back(range);
  }

  const ServoProblemOfJoint& p_;
  std::vector<Knob> knobs_;
  std::vector<bool> free_;
  std::vector<KnobRange> ranges_;
};

struct Equations {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
  double loss = 0.0;
};

Equations equations(const ServoProblemOfJoint& p, const Turned& turned, const Knobs& x, RowSet set,
                    double width) {
  const Eigen::Index n = turned.size();
  Equations out{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), 0.0};
  const ServoJoint joint = servo_of(x);
  Eigen::VectorXd J(n);
  Eigen::Index count = 0;
  for (const ServoRows& rows : p.rows)
    run_knobs<true>(joint, rows, p, x, [&](Eigen::Index i, const auto& state) {
      if (!counts(rows, i, set)) return;
      const double r = rows.series.q[i] - state.q;
      const double weight = std::abs(r) <= width ? 1.0 : width / std::abs(r);
      const KnobSlopes slopes = knob_slopes(x, state.dq);
      for (Eigen::Index k = 0; k < n; ++k)
        J[k] = slopes[static_cast<Eigen::Index>(at(turned.knob(k)))] * turned.slope(k, x);
      out.A.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
      out.b += weight * r * J;
      out.loss += huber(r, width);
      ++count;
    });
  const double scale = count > 0 ? 1.0 / double(count) : 0.0;
  out.A = scale * Eigen::MatrixXd(out.A.selfadjointView<Eigen::Lower>());
  out.b *= scale;
  out.loss *= scale;
  return out;
}

}  // namespace

double nominal_deviation(const ServoProblemOfJoint& p, Knob k) {
  if (is_load_part(k)) return in_parts(p) ? 1.0 : 0.0;
  if (k == Knob::load_gain && in_parts(p)) return 0.0;
  return p.tolerance * std::abs(p.nominal[at(k)]);
}

Eigen::VectorXd servo_motion(const ServoProblemOfJoint& p, const Knobs& x, const ServoRows& rows) {
  Eigen::VectorXd q = rows.series.q;
  run_knobs<false>(servo_of(x), rows, p, x, [&](Eigen::Index i, const auto& state) { q[i] = state.q; });
  return q;
}

double servo_loss(const ServoProblemOfJoint& p, const Knobs& x, RowSet set, double width) {
  const ServoJoint joint = servo_of(x);
  double sum = 0.0;
  Eigen::Index count = 0;
  for (const ServoRows& rows : p.rows)
    run_knobs<false>(joint, rows, p, x, [&](Eigen::Index i, const auto& state) {
      if (!counts(rows, i, set)) return;
      sum += huber(rows.series.q[i] - state.q, width);
      ++count;
    });
  return count > 0 ? sum / double(count) : 0.0;
}

KnobFit fit_knobs(const ServoProblemOfJoint& p, const Knobs& start, const std::vector<Knob>& free, RowSet set,
                  double width, double samples, int iterations) {
  constexpr double converged = 1e-5;    // of the loss, relative
  constexpr double longest_step = 1.0;  // of a logarithm: a factor e
  const Turned turned(p, free);
  const Eigen::Index n = turned.size();
  Eigen::VectorXd y = turned.of(start);
  const Eigen::VectorXd centre = turned.of(p.nominal);
  KnobFit out;
  out.width = width;
  out.x = turned.knobs(start, y);
  out.loss = servo_loss(p, out.x, set, width);
  out.penalty = turned.penalty(y);
  double damping = 1e-3;
  bool moved = true;
  for (int iteration = 0; iteration < iterations && moved; ++iteration) {
    const Equations e = equations(p, turned, out.x, set, width);
    // The loss a sample beside the prior: the loss itself says how large an error is a likely one.
    const double variance = std::max(2.0 * e.loss, p.floor * p.floor), weight = variance / samples;
    Eigen::MatrixXd A = e.A;
    Eigen::VectorXd b = e.b;
    for (Eigen::Index k = 0; k < n; ++k)
      if (!turned.free(k)) {
        const double precision = weight / (turned.sigma(k) * turned.sigma(k));
        A(k, k) += precision;
        b[k] -= precision * (y[k] - centre[k]);
      }
    const double whole = e.loss + weight * out.penalty;
    moved = false;
    for (int attempt = 0; attempt < 7 && !moved; ++attempt) {
      Eigen::MatrixXd damped = A;
      Eigen::VectorXd right = b;
      damped.diagonal() *= 1.0 + damping;
      for (Eigen::Index k = 0; k < n; ++k) {
        const bool held = (y[k] <= turned.low(k) && right[k] <= 0.0) ||
                          (y[k] >= turned.high(k) && right[k] >= 0.0) || !(damped(k, k) > 0.0);
        if (!held) continue;
        damped.row(k).setZero();
        damped.col(k).setZero();
        damped(k, k) = 1.0;
        right[k] = 0.0;
      }
      // Scaled by the diagonal: knobs have units of their own.
      const Eigen::VectorXd scale = damped.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd scaled = scale.asDiagonal() * damped * scale.asDiagonal();
      Eigen::VectorXd next = y + scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(right)));
      for (Eigen::Index k = 0; k < n; ++k) {
        if (turned.range(k).logarithmic)
          next[k] = std::clamp(next[k], y[k] - longest_step, y[k] + longest_step);
        next[k] = std::clamp(next[k], turned.low(k), turned.high(k));
      }
      if (!next.allFinite()) {
        damping *= 5.0;
        continue;
      }
      const Knobs candidate = turned.knobs(start, next);
      const double loss = servo_loss(p, candidate, set, width), penalty = turned.penalty(next);
      if (loss + weight * penalty < whole) {
        moved = whole - (loss + weight * penalty) > converged * whole;
        y = next;
        out.x = candidate;
        out.loss = loss;
        out.penalty = penalty;
        damping = std::max(damping / 5.0, 1e-9);
        break;
      }
      damping *= 5.0;
    }
  }
  return out;
}

KnobFit fit_from(const ServoProblemOfJoint& p, const std::vector<Knobs>& starts,
                 const std::vector<Knob>& free, RowSet set, double width, double samples, int iterations) {
  std::size_t best = 0;
  double least = 0.0;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const double loss = servo_loss(p, starts[k], set, width);
    if (k == 0 || loss < least) least = loss, best = k;
  }
  return fit_knobs(p, starts[best], free, set, width, samples, iterations);
}

double servo_width(const ServoProblemOfJoint& p, const Knobs& x) {
  std::vector<double> r;
  for (const ServoRows& rows : p.rows) {
    const Eigen::VectorXd q = servo_motion(p, x, rows);
    for (Eigen::Index i = 1; i < q.size(); ++i)
      if (counts(rows, i, RowSet::fit)) r.push_back(std::abs(q[i] - rows.series.q[i]));
  }
  return huber_constant * std::max(r.empty() ? 0.0 : deviations_to_sigma * median(std::move(r)), p.floor);
}

double independent_samples(const Eigen::VectorXd& r) {
  constexpr double uncorrelated = 0.05;
  const Eigen::Index n = r.size();
  const double energy = r.squaredNorm();
  double correlated = 0.0;
  if (energy > 0.0)
    for (Eigen::Index lag = 1; lag < n / 4; ++lag) {
      const double rho = r.head(n - lag).dot(r.tail(n - lag)) / energy;
      if (rho < uncorrelated) break;
      correlated += rho;
    }
  return double(n) / (1.0 + 2.0 * correlated);
}

double independent_samples(const ServoProblemOfJoint& p, const Knobs& x) {
  constexpr Eigen::Index least = 8;  // rows that say anything of their correlation
  double sum = 0.0;
  for (const ServoRows& rows : p.rows) {
    const Eigen::VectorXd q = servo_motion(p, x, rows);
    Eigen::VectorXd r(q.size());
    Eigen::Index n = 0;
    for (Eigen::Index i = 1; i < q.size(); ++i)
      if (counts(rows, i, RowSet::fit)) r[n++] = q[i] - rows.series.q[i];
    if (n >= least && r.head(n).squaredNorm() > 0.0) sum += independent_samples(r.head(n));
  }
  return std::max(sum / p.temperature, 3.0);
}

double log_evidence(const ServoProblemOfJoint& p, const KnobFit& fit, double samples) {
  return -0.5 * samples * std::log(2.0 * fit.loss + p.floor * p.floor) - fit.penalty;
}

Eigen::MatrixXd knob_covariance(const ServoProblemOfJoint& p, const KnobFit& fit,
                                const std::vector<Knob>& free, double samples) {
  const Turned turned(p, free);
  const Equations e = equations(p, turned, fit.x, RowSet::fit, fit.width);
  const double variance = std::max(2.0 * e.loss, p.floor * p.floor);
  Eigen::MatrixXd A = e.A * (samples / variance);
  for (Eigen::Index k = 0; k < turned.size(); ++k) {
    if (!turned.free(k)) A(k, k) += 1.0 / (turned.sigma(k) * turned.sigma(k));
    if (!(A(k, k) > 0.0)) A(k, k) = 1e-300;
  }
  const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  scaled.diagonal().array() += 1e-10;
  const Eigen::MatrixXd inverse = scale.asDiagonal() *
                                  scaled.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols())) *
                                  scale.asDiagonal();
  const auto m = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd out = inverse.topLeftCorner(m, m);
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index k = 0; k < m; ++k) out(i, k) *= turned.slope(i, fit.x) * turned.slope(k, fit.x);
  return out;
}

double tolerated_motion(const ServoProblemOfJoint& p) {
  const Turned turned(p, {});
  const ServoJoint joint = servo_of(p.nominal);
  Eigen::VectorXd energy = Eigen::VectorXd::Zero(turned.size());
  Eigen::Index count = 0;
  for (const ServoRows& rows : p.rows)
    run_knobs<true>(joint, rows, p, p.nominal, [&](Eigen::Index, const auto& state) {
      const KnobSlopes slopes = knob_slopes(p.nominal, state.dq);
      for (Eigen::Index k = 0; k < turned.size(); ++k) {
        const double change = turned.sigma(k) * slopes[static_cast<Eigen::Index>(at(turned.knob(k)))];
        energy[k] += change * change;
      }
      ++count;
    });
  return count > 0 ? std::sqrt(energy.sum() / double(count)) : 0.0;
}

}  // namespace dynid::detail
