// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/prepare.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/base/text.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/spectrum.hpp"

namespace dynid {
namespace {

constexpr double spectrum_window = 20.0;  // [s]

std::string sentence(std::initializer_list<const char*> words, std::initializer_list<double> numbers) {
  std::string text;
  auto number = numbers.begin();
  for (const char* word : words) {
    text += word;
    if (number != numbers.end()) text += short_number(*number++, 4);
  }
  return text;
}

/// Rows that say something new: not the same instant, nor the same reading under another stamp.
std::vector<Eigen::Index> fresh_rows(const Log& log) {
  std::vector<Eigen::Index> rows;
  rows.reserve(static_cast<std::size_t>(log.samples()));
  for (Eigen::Index i = 0; i < log.samples(); ++i) {
    if (!rows.empty()) {
      const Eigen::Index p = rows.back();
      if (log.t[i] <= log.t[p]) continue;
      if (log.q.row(i) == log.q.row(p) && (log.tau.size() == 0 || log.tau.row(i) == log.tau.row(p)) &&
          (log.dq.size() == 0 || log.dq.row(i) == log.dq.row(p)))
        continue;
    }
    rows.push_back(i);
  }
  return rows;
}

Eigen::VectorXd pick(const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Index* rows,
                     Eigen::Index count) {
  Eigen::VectorXd out(count);
  for (Eigen::Index i = 0; i < count; ++i) out[i] = x[rows[i]];
  return out;
}

Eigen::VectorXd uniform_grid(double start, double end, double rate) {
  const auto n = static_cast<Eigen::Index>(std::floor((end - start) * rate + 1e-9)) + 1;
  return Eigen::VectorXd::LinSpaced(n, start, start + double(n - 1) / rate);
}

struct Interval {
  std::vector<Eigen::Index> rows;  // fresh
  double rate = 0.0;               // [Hz]
};

Interval fresh_interval(const Log& log) {
  Interval out;
  out.rows = fresh_rows(log);
  if (out.rows.size() < 16)
    throw Error(log.source + ": " + std::to_string(out.rows.size()) +
                " samples that differ from one another: at least 16 are needed");
  std::vector<double> steps;
  steps.reserve(out.rows.size());
  for (std::size_t i = 1; i < out.rows.size(); ++i)
    steps.push_back(log.t[out.rows[i]] - log.t[out.rows[i - 1]]);
  out.rate = 1.0 / median(std::move(steps));
  return out;
}

/// dq(t) = gain v(t - lag), v the derivative of q, of one joint; error: standard deviation of the lag [s],
/// from how it differs between blocks of the log. A joint at rest has none: error is 0.
struct Lag {
  double value = 0.0, error = 0.0, gain = 1.0;
};

Lag velocity_lag(const Eigen::VectorXd& t, const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                 const Eigen::VectorXd& grid, double rate, double cutoff) {
  constexpr Eigen::Index blocks = 10;
  constexpr double longest = 0.5;  // step, in parts of 1 / cutoff
  const ZeroPhaseButterworth filter(cutoff, rate);
  Eigen::MatrixXd v = interpolate(t, q, grid);
  filter.apply(v);
  v = differentiate(v, rate);
  const Eigen::MatrixXd a = differentiate(v, rate);
  const Eigen::Index size = grid.size() / blocks;
  Lag out;
  const double still = 1e-9 * double(grid.size());
  if (a.squaredNorm() <= still || v.squaredNorm() <= still || size < 2) return {};
  // The gain is fitted along: a speed in other units, or by other stamps, is not late.
  const auto fit = [&](const Eigen::MatrixXd& w, Eigen::Index first, Eigen::Index count) -> Eigen::Vector2d {
    const Eigen::VectorXd vs = v.col(0).segment(first, count), as = a.col(0).segment(first, count),
                          ws = w.col(0).segment(first, count);
    const double vv = vs.squaredNorm(), va = vs.dot(as), aa = as.squaredNorm(), vw = vs.dot(ws),
                 aw = as.dot(ws);
    const double det = vv * aa * (1.0 + 1e-12) - va * va;
    return {(aa * vw - va * aw) / det, (vv * aw - va * vw) / det};
  };
  const double most = longest / cutoff;
  Eigen::MatrixXd w;
  for (int pass = 0; pass < 5; ++pass) {  // a first-order step, repeated, reaches lags beyond one sample
    w = interpolate(t, dq, grid.array() + out.value);
    filter.apply(w);
    const Eigen::Vector2d x = fit(w, 0, grid.size());
    out.gain = x[0];
    if (!(std::abs(x[0]) > 1e-9)) return {};
    if (pass < 4) out.value += std::clamp(-x[1] / x[0], -most, most);
  }
  double weight = 0.0, sum = 0.0;
  for (Eigen::Index b = 0; b < blocks; ++b) {
    const double here = a.middleRows(b * size, size).squaredNorm();
    const Eigen::Vector2d x = fit(w, b * size, size);
    if (!(here > 1e-3 * a.squaredNorm() / blocks) || !x.allFinite()) continue;
    weight += here;
    sum += std::pow(here * x[1] / out.gain, 2);
  }
  out.error = std::sqrt(sum * blocks / (blocks - 1.0)) / std::max(weight, 1e-300);
  return out;
}

std::vector<Lag> velocity_lags(const Log& log, const Interval& in, double cutoff) {
  const auto count = static_cast<Eigen::Index>(in.rows.size());
  const Eigen::VectorXd t = pick(log.t, in.rows.data(), count);
  const Eigen::VectorXd grid = uniform_grid(t[0], t[count - 1], in.rate);
  std::vector<Lag> out;
  for (int j = 0; j < log.joints(); ++j)
    out.push_back(velocity_lag(t, pick(log.q.col(j), in.rows.data(), count),
                               pick(log.dq.col(j), in.rows.data(), count), grid, in.rate,
                               std::min(cutoff, 0.4 * in.rate)));
  return out;
}

/// Names what dq has against the derivative of q, and mends the lag: one time for all joints where they
/// agree.
void check_velocity(const Log& log, const Interval& in, const PrepareOptions& options, PreparedLog& out) {
  // In parts of the band's time constant: a lag that changes nothing that is seen in the band; lags that are
  // one. A gain nearer to 1 than least_gain is within what stamps and encoders are.
  constexpr double least_lag = 0.003, alike = 0.01, least_gain = 0.02, sure = 4.0;
  const std::vector<Lag> lags = velocity_lags(log, in, out.cutoff);
  std::vector<double> values;
  for (const Lag& lag : lags)
    if (lag.error > 0.0) values.push_back(lag.value);
  if (values.empty()) return;
  const double common = median(values);
  const auto agrees = [&](const Lag& lag) {
    return std::abs(lag.value - common) <= std::max(sure * lag.error, alike / out.cutoff);
  };
  const bool together =
      std::all_of(lags.begin(), lags.end(), [&](const Lag& lag) { return lag.error == 0.0 || agrees(lag); });
  std::vector<int> all, scaled;
  std::vector<double> gains, errors;
  for (std::size_t j = 0; j < lags.size(); ++j) {
    const Lag& lag = lags[j];
    if (lag.error > 0.0 && std::abs(lag.gain - 1.0) > least_gain) {
      scaled.push_back(static_cast<int>(j) + 1);
      gains.push_back(lag.gain);
    }
    if (lag.error > 0.0) errors.push_back(lag.error);
    if (together) all.push_back(static_cast<int>(j) + 1);
  }
  const auto say = [&](const std::vector<int>& joints, double value, double error) {
    if (std::abs(value) <= least_lag / out.cutoff || std::abs(value) <= sure * error) return;
    if (options.mend_velocity_lag)
      for (const int j : joints) out.velocity_lag[j - 1] = value;
    out.report.issues.push_back(
        {"velocity_lag", joints, value, "s",
         sentence({"the logged dq comes ", " ms (", " to ",
                   options.mend_velocity_lag ? ") after the derivative of q; realigned"
                                             : ") after the derivative of q"},
                  {1e3 * value, 1e3 * (value - 1.645 * error), 1e3 * (value + 1.645 * error)})});
  };
  if (together) {
    say(all, common, median(errors) / std::sqrt(double(errors.size())));
  } else {
    for (std::size_t j = 0; j < lags.size(); ++j)
      if (lags[j].error > 0.0) say({static_cast<int>(j) + 1}, lags[j].value, lags[j].error);
  }
  if (!scaled.empty())
    out.report.issues.push_back(
        {"velocity_gain", scaled, median(gains), "1",
         sentence({"the logged dq is ", " times the derivative of q by the stamps"}, {median(gains)})});
}

/// Noise of the acceleration just above the band, once differentiated from dq and twice from q.
bool velocity_is_quieter(const Log& log, const Interval& in, double cutoff) {
  const auto count = static_cast<Eigen::Index>(in.rows.size());
  const Eigen::VectorXd t = pick(log.t, in.rows.data(), count);
  const Eigen::VectorXd grid = uniform_grid(t[0], t[count - 1], in.rate);
  int votes = 0;
  for (int j = 0; j < log.joints(); ++j) {
    const Spectrum p =
        welch(interpolate(t, pick(log.q.col(j), in.rows.data(), count), grid), in.rate, spectrum_window);
    const Spectrum v =
        welch(interpolate(t, pick(log.dq.col(j), in.rows.data(), count), grid), in.rate, spectrum_window);
    double from_position = 0.0, from_velocity = 0.0;
    for (Eigen::Index k = 0; k < p.frequency.size(); ++k) {
      const double f = p.frequency[k], w2 = f * f;
      if (f < cutoff || f > 2.0 * cutoff) continue;
      from_position += p.density[k] * w2 * w2 * 4.0 * M_PI * M_PI;
      from_velocity += v.density[k] * w2;
    }
    votes += from_velocity <= from_position ? 1 : -1;
  }
  return votes >= 0;
}

/// What was remarked when the log was read.
void check_reading(const Log& log, DataReport& report) {
  report.columns = log.columns;
  for (const LogNote& note : log.notes)
    report.issues.push_back({note.name, note.joints, note.value, note.unit, note.text});
  if (!log.unread.empty())
    report.issues.push_back({"unread_columns",
                             {},
                             double(log.unread.size()),
                             "1",
                             "columns that were not read: " + join(log.unread)});
}

void check_timing(const Log& log, const Interval& in, DataReport& report) {
  const auto dropped = double(log.samples()) - double(in.rows.size());
  if (dropped > 0)
    report.issues.push_back({"repeated_rows",
                             {},
                             dropped / double(log.samples()),
                             "1",
                             sentence({"", " % of the rows repeat the one before; dropped"},
                                      {100.0 * dropped / double(log.samples())})});
  double sum = 0.0, longest = 0.0;
  long regular = 0, gaps = 0;
  for (std::size_t i = 1; i < in.rows.size(); ++i) {
    const double step = log.t[in.rows[i]] - log.t[in.rows[i - 1]];
    longest = std::max(longest, step);
    if (step * in.rate > 3.0) {
      ++gaps;
    } else {
      sum += (step - 1.0 / in.rate) * (step - 1.0 / in.rate);
      ++regular;
    }
  }
  const double jitter = std::sqrt(sum / double(std::max(regular, 1L)));
  if (jitter * in.rate > 0.02)
    report.issues.push_back(
        {"jitter",
         {},
         jitter,
         "s",
         sentence({"intervals of ", " ms scatter by ", " ms; resampled"}, {1e3 / in.rate, 1e3 * jitter})});
  if (gaps > 0)
    report.issues.push_back({"gaps",
                             {},
                             longest,
                             "s",
                             sentence({"", " intervals are longer than three samples, the longest ",
                                       " ms; bridged, or cut "
                                       "where the filter could not bridge them"},
                                      {double(gaps), 1e3 * longest})});
}

void check_channels(const Log& log, const Interval& in, DataReport& report) {
  const auto count = static_cast<Eigen::Index>(in.rows.size());
  std::vector<int> saturated, constant, quantised;
  double quantum = 0.0;
  for (int j = 0; j < log.joints(); ++j) {
    if (log.tau.size() > 0) {
      const Eigen::VectorXd tau = pick(log.tau.col(j), in.rows.data(), count);
      const double low = tau.minCoeff(), high = tau.maxCoeff();
      if (low == high) {
        constant.push_back(j + 1);
      } else {
        Eigen::Index run = 0, longest = 0;
        for (Eigen::Index i = 0; i < count; ++i) {
          run = (tau[i] == low || tau[i] == high) ? run + 1 : 0;
          longest = std::max(longest, run);
        }
        if (longest >= 10) saturated.push_back(j + 1);
      }
    }
    // Quantised: nearly all steps are whole multiples of the smallest one, and it is not mere printing
    // precision.
    std::vector<double> steps;
    for (Eigen::Index i = 1; i < count; ++i) {
      const double step = std::abs(log.q(in.rows[static_cast<std::size_t>(i)], j) -
                                   log.q(in.rows[static_cast<std::size_t>(i - 1)], j));
      if (step > 1e-9) steps.push_back(step);
    }
    if (steps.size() < 32) continue;
    const double least = *std::min_element(steps.begin(), steps.end());
    const auto whole = std::count_if(steps.begin(), steps.end(), [&](double s) {
      return std::abs(s / least - std::round(s / least)) < 0.05;
    });
    if (least >= 2e-5 && double(whole) > 0.95 * double(steps.size())) {
      quantised.push_back(j + 1);
      quantum = std::max(quantum, least);
    }
  }
  if (!constant.empty())
    report.issues.push_back({"constant_channel", constant, 0.0, "N m", "a torque channel never changes"});
  if (!saturated.empty())
    report.issues.push_back({"saturation", saturated, double(saturated.size()), "1",
                             "torque stays at its extreme value for ten samples or more"});
  if (!quantised.empty())
    report.issues.push_back({"quantisation", quantised, quantum, "rad",
                             sentence({"positions move in steps of ", " rad; filtered"}, {quantum})});
}

}  // namespace

double choose_cutoff(const Log& log) {
  const Interval in = fresh_interval(log);
  const auto count = static_cast<Eigen::Index>(in.rows.size());
  const Eigen::VectorXd t = pick(log.t, in.rows.data(), count);
  const Eigen::VectorXd grid = uniform_grid(t[0], t[count - 1], in.rate);
  const bool from_velocity = log.dq.size() > 0;
  double quickest = 0.0;
  for (int j = 0; j < log.joints(); ++j) {
    const auto& channel = from_velocity ? log.dq : log.q;
    Spectrum s =
        welch(interpolate(t, pick(channel.col(j), in.rows.data(), count), grid), in.rate, spectrum_window);
    if (!from_velocity) s.density.array() *= s.frequency.array().square();
    const double total = s.density.sum();
    double part = 0.0;
    for (Eigen::Index k = 0; k < s.density.size() && total > 0.0; ++k) {
      part += s.density[k];
      if (part < 0.99 * total) continue;
      quickest = std::max(quickest, s.frequency[k]);
      break;
    }
  }
  return std::min(std::max(10.0 * quickest, 1.0), in.rate / 6.0);
}

PreparedLog prepare(const Log& log, const PrepareOptions& options) {
  if (log.t.size() == 0) throw Error(log.source + ": column t is missing");
  if (log.tau.size() == 0) throw Error(log.source + ": column tau1 is missing");
  const Interval in = fresh_interval(log);
  const int n = log.joints();

  PreparedLog out;
  out.source = log.source;
  out.report.samples = log.samples();
  out.report.rate_hz = in.rate;
  out.report.duration = log.t[log.t.size() - 1] - log.t[0];
  check_reading(log, out.report);
  check_timing(log, in, out.report);
  check_channels(log, in, out.report);

  out.cutoff = options.cutoff > 0.0 ? options.cutoff : choose_cutoff(log);
  if (out.cutoff >= 0.5 * in.rate) {
    std::ostringstream text;
    text << log.source << ": cut-off frequency " << out.cutoff << " Hz: the log's rate of " << in.rate
         << " Hz allows less than " << 0.5 * in.rate << " Hz";
    throw Error(text.str());
  }

  const bool has_velocity = log.dq.size() > 0;
  out.velocity_lag = Eigen::VectorXd::Zero(n);
  if (has_velocity) check_velocity(log, in, options, out);
  out.motion = options.source;
  if (!has_velocity) out.motion = MotionSource::position;
  if (out.motion == MotionSource::automatic)
    out.motion = velocity_is_quieter(log, in, out.cutoff) ? MotionSource::velocity : MotionSource::position;

  // The grid is fine enough for cubic interpolation between slow samples, and is thinned to about 25 x the
  // cut-off.
  const double up = std::max(1.0, std::ceil(10.0 * out.cutoff / in.rate));
  const double fine = in.rate * up;
  const auto stride = options.thin ? std::max<Eigen::Index>(
                                         1, static_cast<Eigen::Index>(std::floor(fine / (25.0 * out.cutoff))))
                                   : 1;
  const double rate = fine / double(stride);
  const ZeroPhaseButterworth band(out.cutoff, fine);
  const double longest_bridge = std::max(5.0 / in.rate, 0.25 / out.cutoff);
  const double shortest_segment = 2.0 / out.cutoff + 16.0 / in.rate;

  double dropped = 0.0;
  for (std::size_t first = 0; first < in.rows.size();) {
    std::size_t last = first + 1;
    while (last < in.rows.size() &&
           (options.bridge_gaps || log.t[in.rows[last]] - log.t[in.rows[last - 1]] <= longest_bridge))
      ++last;
    const Eigen::Index* rows = in.rows.data() + first;
    const auto count = static_cast<Eigen::Index>(last - first);
    first = last;
    const double length = log.t[rows[count - 1]] - log.t[rows[0]];
    if (length < shortest_segment) {
      dropped += length;
      continue;
    }
    const Eigen::VectorXd t = pick(log.t, rows, count);
    const Eigen::VectorXd grid = uniform_grid(t[0], t[count - 1], fine);
    const Eigen::Index size = (grid.size() - 1) / stride + 1;
    const auto thin = [&](const Eigen::MatrixXd& x) -> Eigen::VectorXd {
      return Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<>>(x.data(), size,
                                                                        Eigen::InnerStride<>(stride));
    };
    Segment s;
    s.rate = rate;
    s.t = thin(grid);
    for (Eigen::MatrixXd* m : {&s.q, &s.dq, &s.ddq, &s.tau}) m->resize(size, n);
    if (options.speed_cutoff > 0.0) s.speed.resize(size, n);
    // One channel at a time: a log of hours must not stand in memory several times over.
    for (int j = 0; j < n; ++j) {
      Eigen::MatrixXd x = interpolate(t, pick(log.q.col(j), rows, count), grid);
      band.apply(x);
      s.q.col(j) = thin(x);
      if (out.motion == MotionSource::velocity) {
        x = interpolate(t, pick(log.dq.col(j), rows, count), grid.array() + out.velocity_lag[j]);
        band.apply(x);
      } else {
        x = differentiate(x, fine);
      }
      s.dq.col(j) = thin(x);
      s.ddq.col(j) = thin(differentiate(x, fine));
      if (options.speed_cutoff > 0.0) {
        if (has_velocity)
          x = interpolate(t, pick(log.dq.col(j), rows, count), grid.array() + out.velocity_lag[j]);
        else
          x = differentiate(interpolate(t, pick(log.q.col(j), rows, count), grid), fine);
        ZeroPhaseButterworth(std::min(options.speed_cutoff, 0.4 * std::min(in.rate, rate)), fine).apply(x);
        s.speed.col(j) = thin(x);
      }
      x = interpolate(t, pick(log.tau.col(j), rows, count), grid);
      if (stride > 1) ZeroPhaseButterworth(0.4 * rate, fine).apply(x);
      s.tau.col(j) = thin(x);
    }
    out.segments.push_back(std::move(s));
  }
  if (out.segments.empty()) {
    std::ostringstream text;
    text << log.source << ": no stretch without gaps is longer than " << shortest_segment
         << " s, which a cut-off of " << out.cutoff << " Hz needs";
    throw Error(text.str());
  }
  if (dropped > 0.0)
    out.report.issues.push_back(
        {"short_segments",
         {},
         dropped,
         "s",
         sentence({"", " s stand between gaps and are too short to filter; dropped"}, {dropped})});
  return out;
}

}  // namespace dynid
