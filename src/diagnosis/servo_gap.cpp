// SPDX-License-Identifier: Apache-2.0
#include "servo_gap.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/joint_scale.hpp"

namespace dynid::detail {
namespace {

constexpr int parts_of_a_log = 6, windows_of_a_log = 4;

/// Chance that a model within the tolerance, of a few independent ways to be off, makes an error of mean
/// square `energy`; noise has its own spread, of the samples there are.
double chance_of(double energy, double tolerance, double floor, double samples) {
  const double beyond = energy - floor * floor,
               allowed = tolerance * tolerance + floor * floor * (1.645 * std::sqrt(2.0 / samples));
  return beyond > 0.0 ? std::erfc(std::sqrt(beyond / allowed / 2.0)) : 1.0;
}

Eigen::VectorXd speeds(const Log& log, int joint) {
  Eigen::VectorXd v = Eigen::VectorXd::Zero(log.samples());
  for (Eigen::Index i = 1; i + 1 < log.samples(); ++i)
    if (log.t[i + 1] > log.t[i - 1])
      v[i] = (log.q(i + 1, joint) - log.q(i - 1, joint)) / (log.t[i + 1] - log.t[i - 1]);
  return v;
}

}  // namespace

std::vector<std::vector<char>> judging_rows(const std::vector<Log>& logs, bool spread) {
  std::vector<std::vector<char>> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const auto n = static_cast<std::size_t>(logs[l].samples());
    const bool parts = spread || logs.size() == 1;
    std::vector<char> rows(n, !parts && l + 1 == logs.size() ? 1 : 0);
    if (parts)
      for (std::size_t i = 0; i < n; ++i) rows[i] = (i * parts_of_a_log / n) % 3 == 2 ? 1 : 0;
    out.push_back(std::move(rows));
  }
  return out;
}

double position_floor(const std::vector<ServoSeries>& series) {
  double range = 0.0;
  for (const ServoSeries& s : series)
    range = std::max(range, std::max(s.q.maxCoeff() - s.q.minCoeff(), s.u.maxCoeff() - s.u.minCoeff()));
  if (range <= 0.0) return 0.0;  // what differences of one number leave is rounding
  double step = 0.0;
  std::vector<double> noise;
  for (const ServoSeries& s : series) {
    step = std::max(step, s.resolution);
    // Third differences of what is smooth are small: a joint that rests, or moves slowly, shows its noise.
    std::vector<double> third;
    for (Eigen::Index i = 3; i < s.q.size(); ++i)
      third.push_back(std::abs(s.q[i] - 3.0 * s.q[i - 1] + 3.0 * s.q[i - 2] - s.q[i - 3]));
    if (!third.empty()) {
      std::sort(third.begin(), third.end());
      noise.push_back(third[third.size() / 4] / 0.3186 / std::sqrt(20.0));  // quartile of |normal|
    }
  }
  constexpr double least = 1e-6;  // of the travel: finer than any encoder
  return std::max({step / std::sqrt(12.0), noise.empty() ? 0.0 : median(noise), least * range});
}

KnobScale knob_scale(const std::vector<ServoSeries>& series) {
  KnobScale out;
  double squares = 0.0, load = 0.0;
  Eigen::Index moving = 0, samples = 0;
  std::vector<double> intervals;
  for (const ServoSeries& s : series) {
    intervals.push_back(s.interval);
    for (Eigen::Index i = 1; i < s.t.size(); ++i)
      if (s.t[i] > s.t[i - 1] && s.u[i] != s.u[i - 1]) {
        const double v = (s.u[i] - s.u[i - 1]) / (s.t[i] - s.t[i - 1]);
        squares += v * v;
        ++moving;
      }
    out.lowest = std::min(out.lowest, s.q.minCoeff());
    out.highest = std::max(out.highest, s.q.maxCoeff());
    out.error = std::max(out.error, (s.u - s.q).cwiseAbs().maxCoeff());
    if (s.load.size() == 0) continue;
    load += s.load.squaredNorm();
    samples += s.load.size();
    out.gravity = std::max(out.gravity, s.gravity.cwiseAbs().maxCoeff());
  }
  out.interval = median(intervals);
  out.moves = moving > 0;
  if (moving > 0) out.speed = std::sqrt(squares / double(moving));
  if (samples > 0) out.load = std::sqrt(load / double(samples));
  return out;
}

ServoProblemOfJoint joint_problem(const Robot& nominal, int joint, const std::vector<ServoSeries>& series,
                                  const std::vector<std::vector<char>>& judging,
                                  const DiagnoseServosOptions& options, double floor, int most_rows) {
  ServoProblemOfJoint out;
  out.nominal = knobs_of(nominal, joint);
  out.scale = knob_scale(series);
  out.tolerance = options.tolerance;
  out.temperature = options.criteria.temperature;
  out.floor = floor;
  // Steps that resolve a plain servo of the nominal's frequency, or of one that the sampling shows at best.
  constexpr double fine = 0.1;
  const double fastest =
      std::min(1.0 / std::sqrt(std::max(servo_of(out.nominal).inertia, 1e-300)), 0.5 / out.scale.interval);
  const int resolved = static_cast<int>(std::ceil(out.scale.interval * fastest / fine));
  // What is judged is friction's sticking too, which a search may take coarsely.
  out.substeps = most_rows > 0 ? std::clamp(resolved, 2, 4) : std::clamp(2 * resolved, 6, 12);
  std::size_t fitting = 0;
  for (const std::vector<char>& rows : judging)
    if (std::find(rows.begin(), rows.end(), 0) != rows.end()) ++fitting;
  // Halves are logs where whole logs fit, else halves of each.
  const bool whole_logs =
      fitting > 1 && std::any_of(judging.begin(), judging.end(), [](const std::vector<char>& rows) {
        return std::find(rows.begin(), rows.end(), 0) == rows.end();
      });
  std::size_t seen = 0;
  for (std::size_t l = 0; l < series.size(); ++l) {
    const ServoSeries& s = series[l];
    const Eigen::Index size = s.q.size();
    const bool fits = std::find(judging[l].begin(), judging[l].end(), 0) != judging[l].end();
    if (most_rows > 0 && !fits) continue;
    const Eigen::Index share = most_rows > 0 && fitting > 0 ? most_rows / Eigen::Index(fitting) : size;
    const int windows = share < size ? windows_of_a_log : 1;
    const Eigen::Index length = std::min(size, share) / windows;
    for (int w = 0; w < windows; ++w) {
      const Eigen::Index first = windows == 1 ? 0 : (size - length) * w / (windows - 1);
      ServoRows rows{part_of(s, first, length), {}, {}, first};
      if (first > 0 && s.t[first] > s.t[first - 1])
        rows.series.v0 = (s.q[first] - s.q[first - 1]) / (s.t[first] - s.t[first - 1]);
      const Eigen::Index settling = first > 0 ? length / 10 : 0;  // whose start is not known
      for (Eigen::Index i = 0; i < length; ++i) {
        const auto at = static_cast<std::size_t>(first + i);
        rows.fit.push_back(i >= settling && judging[l][at] == 0 ? 1 : 0);
        rows.half.push_back(whole_logs ? static_cast<char>(seen % 2)
                                       : static_cast<char>(2 * at / static_cast<std::size_t>(size)));
      }
      out.rows.push_back(std::move(rows));
    }
    if (fits) ++seen;
  }
  return out;
}

void measure_servo_gap(const std::vector<Log>& logs, const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<ServoProblemOfJoint>& joints, Diagnosis& d) {
  const auto n = static_cast<Eigen::Index>(joints.size());
  d.rms = d.floor = d.tolerance = d.upper = Eigen::VectorXd::Zero(n);
  d.p_value = 1.0;
  double whole = 0.0;
  std::vector<double> p(joints.size(), 1.0);
  for (Eigen::Index j = 0; j < n; ++j) {
    const ServoProblemOfJoint& joint = joints[static_cast<std::size_t>(j)];
    double energy = 0.0, samples = 0.0;
    Eigen::Index count = 0;
    for (const Eigen::MatrixXd& r : before) {
      energy += r.col(j).squaredNorm();
      count += r.rows();
      samples += independent_samples(r.col(j));
    }
    d.rms[j] = std::sqrt(energy / double(count));
    d.floor[j] = joint.floor;
    d.tolerance[j] = tolerated_motion(joint);
    d.upper[j] = std::sqrt(std::max(0.0, d.rms[j] * d.rms[j] - d.floor[j] * d.floor[j])) *
                 (1.0 + 1.645 / std::sqrt(2.0 * samples));
    // A joint that was never asked to move may stick anywhere within its friction.
    if (joint.scale.moves)
      p[static_cast<std::size_t>(j)] = chance_of(energy / double(count), d.tolerance[j], d.floor[j], samples);
    d.p_value = std::min(d.p_value, p[static_cast<std::size_t>(j)] * double(n));
    whole += energy / (d.floor[j] * d.floor[j]);
  }
  d.p_value = std::min(1.0, d.p_value);
  d.structure_p_value = d.p_value;
  for (Eigen::Index j = 0; j < n; ++j) {
    std::vector<double> pace;
    std::vector<Eigen::VectorXd> v;
    for (const Log& log : logs) {
      v.push_back(speeds(log, static_cast<int>(j)));
      for (const double x : v.back())
        if (x != 0.0) pace.push_back(std::abs(x));
    }
    const double usual = pace.empty() ? 0.0 : median(pace);
    double cells[5] = {};  // stuck, low speed, high speed; forward, backward
    for (std::size_t l = 0; l < logs.size(); ++l)
      for (Eigen::Index i = 0; i < before[l].rows(); ++i) {
        const double e = before[l](i, j) * before[l](i, j) / (d.floor[j] * d.floor[j]), x = v[l][i];
        cells[x == 0.0 ? 0 : std::abs(x) < usual ? 1 : 2] += e;
        if (x != 0.0) cells[x > 0.0 ? 3 : 4] += e;
      }
    const char* names[] = {"stuck", "low speed", "high speed", "forward", "backward"};
    for (int k = 0; k < 5; ++k)
      d.where.push_back({static_cast<int>(j) + 1, names[k], whole > 0.0 ? cells[k] / whole : 0.0,
                         p[static_cast<std::size_t>(j)]});
  }
}

bool gap_shows_on_both(const std::vector<Eigen::MatrixXd>& before,
                       const std::vector<std::vector<char>>& judging, const Diagnosis& d, double detection) {
  const Eigen::Index n = d.rms.size();
  const auto shows = [&](Eigen::Index j, bool judges) {
    double energy = 0.0, samples = 0.0;
    Eigen::Index count = 0;
    for (std::size_t l = 0; l < before.size(); ++l) {
      Eigen::Index here = 0;
      for (Eigen::Index i = 0; i < before[l].rows(); ++i)
        if ((judging[l][static_cast<std::size_t>(i)] != 0) == judges)
          energy += before[l](i, j) * before[l](i, j), ++here;
      if (here > 0)
        samples += independent_samples(before[l].col(j)) * double(here) / double(before[l].rows());
      count += here;
    }
    return count > 0 &&
           chance_of(energy / double(count), d.tolerance[j], d.floor[j], samples) * double(n) <= detection;
  };
  for (Eigen::Index j = 0; j < n; ++j)
    if (shows(j, false) && shows(j, true)) return true;
  return false;
}

}  // namespace dynid::detail
