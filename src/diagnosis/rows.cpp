// SPDX-License-Identifier: Apache-2.0
#include "rows.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "alike.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

constexpr double edge_periods = 1.0;     // of the cut-off, at either end of a stretch
constexpr Eigen::Index directions = 24;  // of the nuisance, at most
constexpr double usual_error =
    0.03;  // of the nominal's parameters, relatively: the largest that the search assumes
constexpr double least_seen = 0.1;        // of the white floor: what is smaller, in a hundred parts of energy
constexpr double least_floor = 1e-4;      // of the largest load of a joint of its type
constexpr double usual_lateness = 0.025;  // of stamps, in parts of the time between rows

/// What a link's parameters are measured against: an error of its centre of mass or of its inertia may have
/// any direction, and is relative to how far out its mass lies.
Eigen::Matrix<double, 10, 1> sizes(const StandardParameters& p) {
  const double mass = std::abs(p[0]), spread = std::sqrt(std::max(0.0, (p[4] + p[5] + p[6]) / 2.0 * mass));
  Eigen::Matrix<double, 10, 1> out;
  out << mass, Eigen::Vector3d::Constant(std::max(p.segment<3>(1).norm(), 0.5 * spread)),
      Eigen::Matrix<double, 6, 1>::Constant(std::abs(p[4] + p[5] + p[6]) / 3.0);
  return out;
}

/// Counts the directions of the columns, each joint in units of its floor, and makes columns zero that are
/// but what rounding leaves of a zero: they would be fitted to.
void count_directions(RowBlock& block, const Eigen::VectorXd& floor) {
  constexpr double nothing = 1e-8;  // of energies: about what a double resolves of a sum that cancels
  const Eigen::Index size = block.size();
  block.directions = size;
  if (size < 2) return;
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t k = 0; k < block.channels.size(); ++k) {
    const double unit = floor[block.channels[k]];
    G += block.values[k].transpose() * block.values[k] / (unit > 0.0 ? unit * unit : 1.0);
  }
  const double least = nothing * nothing * G.diagonal().maxCoeff();
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(size);
  for (Eigen::Index c = 0; c < size; ++c) {
    if (G(c, c) > least)
      scale[c] = 1.0 / std::sqrt(G(c, c));
    else
      for (Eigen::MatrixXd& values : block.values) values.col(c).setZero();
  }
  G = scale.asDiagonal() * G * scale.asDiagonal();
  const Eigen::VectorXd energies =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(G, Eigen::EigenvaluesOnly).eigenvalues();
  block.directions = std::max<Eigen::Index>(1, (energies.array() > nothing * energies.maxCoeff()).count());
}

/// Rows that follow one another in one part and are as `is` says.
template <class Is>
std::vector<RowWindow> stretches_where(const std::vector<Eigen::Index>& parts, Is&& is) {
  std::vector<RowWindow> out;
  for (std::size_t p = 0; p + 1 < parts.size(); ++p) {
    Eigen::Index since = parts[p];
    for (Eigen::Index i = parts[p]; i <= parts[p + 1]; ++i) {
      if (i < parts[p + 1] && is(i)) continue;
      if (i > since) out.push_back({since, i - since});
      since = i + 1;
    }
  }
  return out;
}

}  // namespace

void GapRows::add(Motions& motions, Stretches& stretches, GapMotion motion, const DecimatingFilter& filter,
                  Eigen::Index edge, int of_log) {
  const Eigen::Index samples = motion.samples();
  Eigen::Index first = 0, last = filter.outputs(samples) - 1;
  while (first <= last && filter.centre(first) < edge) ++first;
  while (last >= first && filter.centre(last) > samples - 1 - edge) --last;
  if (last < first) return;
  stretches.push_back({filter, edge, first, last - first + 1, of_log});
  parts.push_back(parts.back() + last - first + 1);
  log.resize(static_cast<std::size_t>(parts.back()), of_log);
  motions.push_back(std::move(motion));
}

GapRows::GapRows(const Robot& given, std::vector<PreparedLog>& logs) {
  Robot nominal = given;
  nominal.effects.clear();
  Motions motions;
  Stretches stretches;
  parts.push_back(0);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const double start = logs[l].segments.front().t[0], cutoff = logs[l].cutoff;
    Eigen::VectorXd worked = Eigen::VectorXd::Zero(nominal.size());
    for (Segment& segment : logs[l].segments) {
      const double rate = segment.rate;
      const auto factor =
          std::max<Eigen::Index>(1, static_cast<Eigen::Index>(std::floor(rate / (2.5 * cutoff))));
      GapMotion motion(nominal, std::move(segment), start);
      motion.worked = worked;
      if (!given.effects.empty()) {
        motion.known = effect_torque(given, motion);
        motion.nominal += motion.known;
      }
      worked += (motion.speed.colwise().squaredNorm() / rate).transpose();
      add(motions, stretches, std::move(motion),
          DecimatingFilter(ZeroPhaseButterworth(cutoff, rate).half_kernel(), factor),
          static_cast<Eigen::Index>(std::ceil(edge_periods * rate / cutoff)), static_cast<int>(l));
    }
    logs[l].segments.clear();
  }
  fill(std::move(motions), std::move(stretches));
  find_white_floor();
  find_ranges();
  make_nuisance();
}

GapRows::GapRows(const GapRows& whole, const std::vector<RowWindow>& windows) {
  Motions motions;
  Stretches stretches;
  parts.push_back(0);
  for (const RowWindow& window : windows) {
    const std::size_t s = whole.stretch_of(window.first);
    const Stretch& stretch = (*whole.stretches_)[s];
    const GapMotion& motion = (*whole.motions_)[s];
    const Eigen::Index factor = stretch.filter.centre(1) - stretch.filter.centre(0),
                       output = stretch.first + window.first - whole.parts[s],
                       before = (stretch.edge + factor - 1) / factor;
    // Beginning at a multiple of the decimation, the window has the rows of the whole.
    const Eigen::Index begin = factor * std::max<Eigen::Index>(0, output - before),
                       end = std::min(motion.samples(),
                                      stretch.filter.centre(output + window.count - 1) + stretch.edge + 1);
    add(motions, stretches, motion.part(begin, end - begin), stretch.filter, stretch.edge, stretch.log);
  }
  fill(std::move(motions), std::move(stretches));
  white_floor = whole.white_floor;
  coloured_floor = whole.coloured_floor;
  range = whole.range;
  make_nuisance();
}

double GapRows::period() const {
  const DecimatingFilter& filter = stretches_->front().filter;
  return double(filter.centre(1) - filter.centre(0)) / motions_->front().rate;
}

std::size_t GapRows::stretch_of(Eigen::Index row) const {
  return static_cast<std::size_t>(std::upper_bound(parts.begin(), parts.end(), row) - parts.begin()) - 1;
}

void GapRows::fill(Motions motions, Stretches stretches) {
  motions_ = std::make_shared<const Motions>(std::move(motions));
  stretches_ = std::make_shared<const Stretches>(std::move(stretches));
  used_.assign(stretches_->size(), true);
  t.resize(parts.back());
  for (std::size_t s = 0; s < stretches_->size(); ++s)
    for (Eigen::Index k = 0; k < (*stretches_)[s].count; ++k)
      t[parts[s] + k] = (*motions_)[s].t[(*stretches_)[s].filter.centre((*stretches_)[s].first + k)];
  // One after another: the samples of a log of hours are not to stand in memory several times over.
  const auto of = [&](const auto& signal) {
    std::vector<Eigen::MatrixXd> all;
    for (const GapMotion& m : *motions_) all.push_back(signal(m));
    return filtered(all);
  };
  y = of([](const GapMotion& m) -> Eigen::MatrixXd { return m.tau - m.nominal; });
  q = of([](const GapMotion& m) { return m.q; });
  dq = of([](const GapMotion& m) { return m.dq; });
  ddq = of([](const GapMotion& m) { return m.ddq; });
  load = of([](const GapMotion& m) { return m.rigid; });
  timing = of([this](const GapMotion& m) -> Eigen::MatrixXd {
    return usual_lateness * period() * differentiate(m.nominal, m.rate);
  });
  active = Eigen::VectorXd::Constant(y.cols(), double(size()));
}

void GapRows::find_ranges() {
  constexpr double exceeded = 0.995;  // part of the samples: one that stands out is noise
  constexpr double noise_room = 4.0;  // standard deviations: a log that stands at a limit has noise there
  const int n = joints();
  Eigen::Index samples = 0;
  for (const GapMotion& m : *motions_) samples += m.samples();
  Eigen::MatrixXd all_q(samples, n), all_dq(samples, n), all_ddq(samples, n), all_tau(samples, n);
  Eigen::Index at = 0;
  for (const GapMotion& m : *motions_) {
    all_q.middleRows(at, m.samples()) = m.q;
    all_dq.middleRows(at, m.samples()) = m.dq;
    all_ddq.middleRows(at, m.samples()) = m.ddq;
    all_tau.middleRows(at, m.samples()) = m.tau;
    at += m.samples();
  }
  std::vector<JointScale> scales =
      joint_scales(motions_->front().robot(), all_q, all_dq, all_ddq, all_tau, 1.0 / motions_->front().rate);
  double longest = 0.0;  // a motion may be a window of its log, whose time it keeps
  for (const GapMotion& m : *motions_) longest = std::max(longest, m.t[m.samples() - 1]);
  for (JointScale& s : scales) s.recorded = longest;
  for (int j = 0; j < n; ++j) {
    Eigen::VectorXd tau = all_tau.col(j);
    // Third differences leave noise of twenty times the variance and next to nothing of the motion.
    const Eigen::Index third = samples - 3;
    const double noise = third < 1 ? 0.0
                                   : std::sqrt((tau.tail(third) - 3.0 * tau.segment(2, third) +
                                                3.0 * tau.segment(1, third) - tau.head(third))
                                                   .squaredNorm() /
                                               (20.0 * double(third)));
    tau = tau.cwiseAbs();
    const auto rank = static_cast<Eigen::Index>(exceeded * double(samples - 1));
    std::nth_element(tau.data(), tau.data() + rank, tau.data() + samples);
    range.push_back({scales[static_cast<std::size_t>(j)], all_q.col(j).minCoeff(), all_q.col(j).maxCoeff(),
                     std::max(0.0, tau[rank] - noise_room * noise)});
  }
}

void GapRows::find_white_floor() {
  // Third differences leave noise of twenty times the variance and next to nothing of the motion.
  const int n = static_cast<int>(y.cols());
  white_floor = Eigen::VectorXd::Zero(n);
  double samples = 0.0;
  for (std::size_t s = 0; s < motions_->size(); ++s) {
    const Eigen::MatrixXd& x = (*motions_)[s].tau;
    const Eigen::Index size = x.rows() - 3;
    if (size < 1) continue;
    const Eigen::MatrixXd third =
        x.bottomRows(size) - 3.0 * x.middleRows(2, size) + 3.0 * x.middleRows(1, size) - x.topRows(size);
    // What the filter leaves of white noise: the energy of its kernel.
    white_floor += third.colwise().squaredNorm().transpose() / 20.0 * (*stretches_)[s].filter.white_gain();
    samples += double(size);
  }
  white_floor = (white_floor / std::max(1.0, samples)).cwiseSqrt();
  // Interpolation and filters are no better than this, however clean the log.
  const Eigen::VectorXd size = (load.colwise().squaredNorm() / double(load.rows())).cwiseSqrt().transpose();
  white_floor = white_floor.cwiseMax(least_floor * largest_alike(motions_->front().robot(), size));
  coloured_floor = white_floor;
}

void GapRows::allow_for_colour(const std::vector<Log>& logs, double part) {
  Eigen::VectorXd energy = Eigen::VectorXd::Zero(joints());
  double samples = 1e-300;
  for (const Log& of : logs) {
    const Eigen::MatrixXd& x = of.tau;
    for (Eigen::Index i = 3; i < x.rows(); ++i) {
      if (x.row(i) == x.row(i - 1)) continue;  // a packet that was lost
      energy +=
          (x.row(i) - 3.0 * x.row(i - 1) + 3.0 * x.row(i - 2) - x.row(i - 3)).cwiseAbs2().transpose() / 20.0;
      samples += 1.0;
    }
  }
  coloured_floor = white_floor.cwiseMax(part * (energy / samples).cwiseSqrt());
}

GapRows::GapRows(const GapRows& other, const std::vector<bool>& keep)
    : motions_(other.motions_), stretches_(other.stretches_), lateness_(other.lateness_) {
  std::vector<Eigen::Index> rows;
  parts.push_back(0);
  for (std::size_t p = 0; p + 1 < other.parts.size(); ++p) {
    bool before = false;
    for (Eigen::Index i = other.parts[p]; i < other.parts[p + 1]; ++i) {
      const bool now = keep[static_cast<std::size_t>(i)];
      if (!now && before) parts.push_back(static_cast<Eigen::Index>(rows.size()));
      if (now) {
        kept_.push_back(other.kept_.empty() ? i : other.kept_[static_cast<std::size_t>(i)]);
        rows.push_back(i);
        log.push_back(other.log[static_cast<std::size_t>(i)]);
      }
      before = now;
    }
    if (before) parts.push_back(static_cast<Eigen::Index>(rows.size()));
  }
  Eigen::Index end = 0;
  for (const Stretch& stretch : *stretches_) {
    const Eigen::Index begin = end;
    end += stretch.count;
    used_.push_back(
        std::any_of(kept_.begin(), kept_.end(), [&](Eigen::Index i) { return i >= begin && i < end; }));
  }
  y = other.y(rows, Eigen::all);
  q = other.q(rows, Eigen::all);
  dq = other.dq(rows, Eigen::all);
  ddq = other.ddq(rows, Eigen::all);
  load = other.load(rows, Eigen::all);
  t = other.t(rows);
  timing = other.timing(rows, Eigen::all);
  white_floor = other.white_floor;
  coloured_floor = other.coloured_floor;
  range = other.range;
  if (other.moves_.size() > 0) moves_ = other.moves_(rows, Eigen::all);
  active = moves_.size() > 0 ? Eigen::VectorXd(moves_.colwise().sum().transpose().cwiseMax(1.0))
                             : Eigen::VectorXd::Constant(y.cols(), double(size()));
  for (const Eigen::MatrixXd& columns : other.nuisance) nuisance.emplace_back(columns(rows, Eigen::all));
}

double GapRows::start(int of_log) const {
  for (std::size_t s = 0; s < stretches_->size(); ++s)
    if ((*stretches_)[s].log == of_log) return (*motions_)[s].start;
  return 0.0;
}

Eigen::MatrixXd GapRows::filtered(const std::vector<Eigen::MatrixXd>& signals) const {
  Eigen::Index columns = 0;
  for (const Eigen::MatrixXd& signal : signals) columns = std::max(columns, signal.cols());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(parts.back(), columns);  // also while y is made
  for (std::size_t s = 0; s < signals.size(); ++s) filter_stretch(s, signals[s], out);
  return out;
}

void GapRows::filter_stretch(std::size_t s, const Eigen::MatrixXd& x, Eigen::MatrixXd& out) const {
  constexpr Eigen::Index rows_of_a_task = 64;
  const Stretch& stretch = (*stretches_)[s];
  Eigen::Index before = 0;  // rows of the stretches before, were all rows kept
  for (std::size_t k = 0; k < s; ++k) before += (*stretches_)[k].count;
  Eigen::Index first = before, last = before + stretch.count;  // among the rows that are kept
  if (!kept_.empty()) {
    const auto place = [this](Eigen::Index row) -> Eigen::Index {
      return std::lower_bound(kept_.begin(), kept_.end(), row) - kept_.begin();
    };
    first = place(first);
    last = place(last);
  }
  // Many are zero but for a window.
  Eigen::Index begin = 0, end = x.rows();
  while (begin < end && x.row(begin).isZero(0.0)) ++begin;
  while (end > begin && x.row(end - 1).isZero(0.0)) --end;
  if (begin == end) return;
  const Eigen::Index reach = stretch.filter.reach();
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(first, last, rows_of_a_task),
                    [&](const tbb::blocked_range<Eigen::Index>& part) {
                      for (Eigen::Index row = part.begin(); row < part.end(); ++row) {
                        const Eigen::Index k = stretch.first - before +
                                               (kept_.empty() ? row : kept_[static_cast<std::size_t>(row)]);
                        const Eigen::Index centre = stretch.filter.centre(k);
                        if (centre + reach >= begin && centre - reach < end)
                          out.row(row) = stretch.filter.output(k, x, 0, x.rows());
                      }
                    });
}

ColumnBlock GapRows::columns_of(const Hypothesis& h, int unit, const Eigen::VectorXd& shape,
                                std::size_t s) const {
  ColumnBlock out = h.columns((*motions_)[s], unit, shape);
  if (lateness_.size() == 0 || h.lateness(shape) != 0.0) return out;
  const Eigen::VectorXd& time = (*motions_)[s].t;
  for (std::size_t k = 0; k < out.channels.size(); ++k)
    for (auto column : out.values[k].colwise())
      column = interpolate(time, Eigen::VectorXd(column), time.array() - lateness_[out.channels[k]]);
  return out;
}

RowBlock GapRows::block(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const {
  // Stretches are worked at together, but not so many that the columns of a log of hours stand in memory at
  // once.
  constexpr Eigen::Index samples_at_once = 65536;
  RowBlock out;
  out.nominal = h.nominal(motions_->front().robot(), unit);
  for (std::size_t begin = 0, end = 0; begin < motions_->size(); begin = end) {
    Eigen::Index samples = (*motions_)[end++].samples();
    while (end < motions_->size() && samples + (*motions_)[end].samples() <= samples_at_once)
      samples += (*motions_)[end++].samples();
    std::vector<ColumnBlock> blocks(end - begin);
    tbb::parallel_for(begin, end, [&](std::size_t s) {
      if (used_[s]) blocks[s - begin] = columns_of(h, unit, shape, s);
    });
    for (std::size_t s = begin; s < end; ++s) {
      if (!used_[s] || !out.values.empty()) continue;
      out.channels = blocks[s - begin].channels;
      for (const Eigen::MatrixXd& values : blocks[s - begin].values)
        out.values.emplace_back(Eigen::MatrixXd::Zero(size(), values.cols()));
    }
    tbb::parallel_for(std::size_t{0}, out.values.size(), [&](std::size_t k) {
      for (std::size_t s = begin; s < end; ++s)
        if (used_[s]) filter_stretch(s, blocks[s - begin].values[k], out.values[k]);
    });
  }
  if (moves_.size() > 0)
    for (std::size_t k = 0; k < out.channels.size(); ++k)
      out.values[k].array().colwise() *= moves_.col(out.channels[k]).array();
  count_directions(out, white_floor);
  return out;
}

std::vector<ShapeParameter> GapRows::shape(const Hypothesis& h, int unit) const {
  std::vector<JointScale> scales;
  for (const JointRange& r : range) scales.push_back(r.scale);
  return h.shape_of(unit, scales, arm_reach(motions_->front().robot()));
}

GapRows GapRows::late(const Eigen::VectorXd& lateness) const {
  GapRows out = *this;
  out.lateness_ = lateness;
  return out;
}

GapRows GapRows::with_links_off(const Eigen::VectorXd& parts_off) const {
  GapRows out = *this;
  Motions motions = *motions_;
  Robot change = motions.front().robot();  // the torque is linear in the parameters
  for (int j = 0; j < joints(); ++j) {
    StandardParameters& p = change.joints[static_cast<std::size_t>(j)].parameters;
    p = sizes(p).cwiseProduct(parts_off.segment<10>(10 * j));
  }
  const Model<> model(change);
  Workspace<> ws(model);
  Eigen::VectorXd q_i(joints()), dq_i(joints()), ddq_i(joints()), torque(joints());
  for (GapMotion& m : motions) {
    for (Eigen::Index i = 0; i < m.samples(); ++i) {
      q_i = m.q.row(i);
      dq_i = m.dq.row(i);
      ddq_i = m.ddq.row(i);
      inverse_dynamics(model, ws, q_i, dq_i, ddq_i, torque);
      m.rigid.row(i) += torque.transpose();
      m.nominal.row(i) += torque.transpose();
    }
  }
  out.motions_ = std::make_shared<const Motions>(std::move(motions));
  return out;
}

GapRows GapRows::moving(double times) const {
  constexpr Eigen::Index shortest = 3;  // rows: a reversal is shorter
  constexpr double least_moving = 0.2;  // of the rows
  GapRows out = *this;
  // What the wider band has of speed beyond the motion's is what the sensor does not resolve.
  std::vector<Eigen::MatrixXd> beyond;
  for (const GapMotion& m : *motions_) beyond.emplace_back(m.speed - m.dq);
  Eigen::MatrixXd moves = Eigen::MatrixXd::Ones(size(), joints());
  std::vector<int> movers;
  std::vector<bool> rests(static_cast<std::size_t>(size()), true);  // all that move
  for (int j = 0; j < joints(); ++j) {
    std::vector<double> noise;
    for (const Eigen::MatrixXd& x : beyond)
      for (const double v : x.col(j)) noise.push_back(std::abs(v));
    const auto middle = noise.begin() + static_cast<std::ptrdiff_t>(noise.size() / 2);
    std::nth_element(noise.begin(), middle, noise.end());
    const double slow = times * *middle / 0.6745;
    for (const auto& [first, count] :
         stretches_where(parts, [&](Eigen::Index i) { return std::abs(dq(i, j)) < slow; }))
      if (count >= shortest) moves.col(j).segment(first, count).setZero();
    // A joint that hardly moves at all is not looked at in another way than before.
    if (moves.col(j).sum() < least_moving * double(size())) {
      moves.col(j).setOnes();
      continue;
    }
    movers.push_back(j);
    for (Eigen::Index i = 0; i < size(); ++i)
      if (!(std::abs(dq(i, j)) < slow)) rests[static_cast<std::size_t>(i)] = false;
  }
  // Joints that are slow at once do not turn round: the arm is at rest, however shortly, and the filter
  // spreads what they carry then over the rows around.
  const Stretch& stretch = stretches_->front();
  const Eigen::Index factor = stretch.filter.centre(1) - stretch.filter.centre(0),
                     around = (stretch.edge + factor - 1) / factor;
  if (movers.size() < 2) rests.assign(rests.size(), false);
  for (const auto& [first, count] :
       stretches_where(parts, [&](Eigen::Index i) { return bool(rests[static_cast<std::size_t>(i)]); })) {
    if (count >= shortest) continue;
    const auto next = std::upper_bound(parts.begin(), parts.end(), first);
    const Eigen::Index begin = std::max(*(next - 1), first - around),
                       end = std::min(*next, first + count + around);
    for (const int j : movers) moves.col(j).segment(begin, end - begin).setZero();
  }
  out.moves_ = moves;
  out.active = moves.colwise().sum().transpose();
  out.y = y.cwiseProduct(moves);
  out.timing = timing.cwiseProduct(moves);
  for (int j = 0; j < joints(); ++j)
    out.nuisance[static_cast<std::size_t>(j)].array().colwise() *= moves.col(j).array();
  return out;
}

std::vector<Eigen::MatrixXd> GapRows::nuisance_columns(std::size_t s, Eigen::Index first, Eigen::Index count,
                                                       Eigen::Index stride) const {
  const Stretch& stretch = (*stretches_)[s];
  const GapMotion& m = (*motions_)[s];
  const Robot& robot = m.robot();
  const int n = robot.size();
  first += stretch.first;
  const Eigen::Index reach = stretch.filter.reach(),
                     from = std::max<Eigen::Index>(0, stretch.filter.centre(first) - reach),
                     to = std::min(m.samples(), stretch.filter.centre(first + count - 1) + reach + 1);
  const std::vector<Eigen::MatrixXd> all = m.regressor_rows(from, to - from);
  std::vector<Eigen::MatrixXd> out;
  for (int j = 0; j < n; ++j) {
    const JointFriction& f = robot.joints[static_cast<std::size_t>(j)].friction;
    Eigen::MatrixXd columns(to - from, 10 * n + 6);
    for (int l = 0; l < n; ++l)
      columns.middleCols(10 * l, 10) =
          all[static_cast<std::size_t>(j)].middleCols(10 * l, 10) *
          sizes(robot.joints[static_cast<std::size_t>(l)].parameters).asDiagonal();
    for (Eigen::Index i = 0; i < columns.rows(); ++i) {
      const Eigen::RowVector3d linear = friction_regressor(f.linear, m.speed(from + i, j));
      const Eigen::RowVector3d sigmoid = friction_regressor(f.sigmoid, m.speed(from + i, j));
      columns.row(i).tail<6>() << linear[0] * f.linear.viscous, linear[1] * f.linear.coulomb,
          linear[2] * f.linear.offset, sigmoid[0] * f.sigmoid.phi1, sigmoid[1] * f.sigmoid.phi2,
          sigmoid[2] * f.sigmoid.phi3;
    }
    out.emplace_back((count - 1) / stride + 1, columns.cols());
    for (Eigen::Index k = 0; k < out.back().rows(); ++k)
      out.back().row(k) = stretch.filter.output(first + k * stride, columns, from, m.samples());
  }
  return out;
}

void GapRows::make_nuisance() {
  // Block by block: the columns of all parameters over a log of hours would be larger than all the rest.
  constexpr Eigen::Index block = 256, rows_for_directions = 4096;
  struct Job {
    std::size_t stretch;
    Eigen::Index first, count;
  };
  std::vector<Job> jobs;
  for (std::size_t s = 0; s < stretches_->size(); ++s)
    for (Eigen::Index k = 0; k < (*stretches_)[s].count; k += block)
      jobs.push_back({s, k, std::min(block, (*stretches_)[s].count - k)});
  const auto n = static_cast<std::size_t>(joints());
  const Eigen::Index stride = (size() + rows_for_directions - 1) / rows_for_directions;
  Eigen::Index rows_of_directions = 0;
  for (const Job& job : jobs) rows_of_directions += (job.count - 1) / stride + 1;
  std::vector<std::vector<Eigen::MatrixXd>> covariance(jobs.size()), columns(jobs.size());
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t k) {
    std::vector<Eigen::MatrixXd> all =
        nuisance_columns(jobs[k].stretch, jobs[k].first, jobs[k].count, stride);
    for (const Eigen::MatrixXd& x : all) covariance[k].emplace_back(x.transpose() * x);
    if (stride == 1) columns[k] = std::move(all);
  });
  std::vector<Eigen::MatrixXd> main;  // directions of each joint
  for (std::size_t j = 0; j < n; ++j) {
    Eigen::MatrixXd sum = covariance.front()[j];
    for (std::size_t k = 1; k < jobs.size(); ++k) sum += covariance[k][j];
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(sum);
    // Ascending: what errors of the usual size add beside the noise is seen in the last ones alone.
    const double least = least_seen * white_floor[static_cast<Eigen::Index>(j)] / usual_error;
    const Eigen::Index seen =
        (eigen.eigenvalues().array() > least * least * double(rows_of_directions)).count();
    main.emplace_back(eigen.eigenvectors().rightCols(std::clamp<Eigen::Index>(seen, 1, directions)));
    nuisance.emplace_back(size(), main.back().cols());
  }
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t k) {
    if (stride > 1) columns[k] = nuisance_columns(jobs[k].stretch, jobs[k].first, jobs[k].count, 1);
    for (std::size_t j = 0; j < n; ++j)
      nuisance[j].middleRows(parts[jobs[k].stretch] + jobs[k].first, jobs[k].count) = columns[k][j] * main[j];
    columns[k].clear();
  });
}

}  // namespace dynid::detail
