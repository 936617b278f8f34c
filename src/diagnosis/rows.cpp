// SPDX-License-Identifier: Apache-2.0
#include "rows.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "alike.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

constexpr double edge_periods = 1.0;     // of the cut-off, at either end of a stretch
constexpr Eigen::Index directions = 24;  // of the nuisance, at most
constexpr double least_floor = 1e-4;     // of the largest load of a joint of its type
constexpr double usual_lateness = 1e-3;  // [s] of stamps

/// What a link's parameters are measured against: an error of its centre of mass or of its inertia may have
/// any direction, and is relative to how far out its mass lies.
Eigen::Matrix<double, 10, 1> sizes(const StandardParameters& p) {
  const double mass = std::abs(p[0]), spread = std::sqrt(std::max(0.0, (p[4] + p[5] + p[6]) / 2.0 * mass));
  Eigen::Matrix<double, 10, 1> out;
  out << mass, Eigen::Vector3d::Constant(std::max(p.segment<3>(1).norm(), 0.5 * spread)),
      Eigen::Matrix<double, 6, 1>::Constant(std::abs(p[4] + p[5] + p[6]) / 3.0);
  return out;
}

}  // namespace

GapRows::GapRows(const Robot& nominal, const std::vector<PreparedLog>& logs) {
  auto motions = std::make_shared<std::vector<GapMotion>>();
  auto stretches = std::make_shared<std::vector<Stretch>>();
  parts.push_back(0);
  std::vector<double> stamps;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const double start = logs[l].segments.front().t[0];
    for (const Segment& segment : logs[l].segments) {
      const auto factor = std::max<Eigen::Index>(
          1, static_cast<Eigen::Index>(std::floor(segment.rate / (2.5 * logs[l].cutoff))));
      const DecimatingFilter filter(ZeroPhaseButterworth(logs[l].cutoff, segment.rate).half_kernel(), factor);
      const auto edge = static_cast<Eigen::Index>(std::ceil(edge_periods * segment.rate / logs[l].cutoff));
      Eigen::Index first = 0, last = filter.outputs(segment.t.size()) - 1;
      while (first <= last && filter.centre(first) < edge) ++first;
      while (last >= first && filter.centre(last) > segment.t.size() - 1 - edge) --last;
      if (last < first) continue;
      motions->emplace_back(nominal, segment, start);
      stretches->push_back({filter, first, last - first + 1, static_cast<int>(l)});
      parts.push_back(parts.back() + last - first + 1);
      for (Eigen::Index k = first; k <= last; ++k) {
        stamps.push_back(motions->back().t[filter.centre(k)]);
        log.push_back(static_cast<int>(l));
      }
    }
  }
  motions_ = motions;
  stretches_ = stretches;
  used_.assign(stretches->size(), true);
  t = Eigen::Map<Eigen::VectorXd>(stamps.data(), static_cast<Eigen::Index>(stamps.size()));
  std::vector<Eigen::MatrixXd> gap, position, speed, acceleration, torque;
  for (const GapMotion& m : *motions_) {
    gap.push_back(m.tau - m.nominal);
    position.push_back(m.q);
    speed.push_back(m.dq);
    acceleration.push_back(m.ddq);
    torque.push_back(m.rigid);
  }
  y = filtered(gap);
  q = filtered(position);
  dq = filtered(speed);
  ddq = filtered(acceleration);
  load = filtered(torque);
  for (std::size_t s = 0; s < motions_->size(); ++s) {
    const GapMotion& m = (*motions_)[s];
    torque[s] = usual_lateness * differentiate(m.nominal, m.rate);
  }
  timing = filtered(torque);
  find_white_floor();
  find_ranges();
  make_nuisance();
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
  const std::vector<JointScale> scales =
      joint_scales(motions_->front().robot(), all_q, all_dq, all_ddq, all_tau, 1.0 / motions_->front().rate);
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
  range = other.range;
  if (other.moves_.size() > 0) moves_ = other.moves_(rows, Eigen::all);
  active = moves_.size() > 0 ? Eigen::VectorXd(moves_.colwise().sum().transpose().cwiseMax(1.0))
                             : Eigen::VectorXd::Constant(y.cols(), double(size()));
  for (const Eigen::MatrixXd& columns : other.nuisance) nuisance.push_back(columns(rows, Eigen::all));
}

double GapRows::start(int of_log) const {
  for (std::size_t s = 0; s < stretches_->size(); ++s)
    if ((*stretches_)[s].log == of_log) return (*motions_)[s].start;
  return 0.0;
}

Eigen::MatrixXd GapRows::filtered(const std::vector<Eigen::MatrixXd>& signals) const {
  Eigen::Index rows = 0, columns = 0;
  for (const Stretch& stretch : *stretches_) rows += stretch.count;
  for (const Eigen::MatrixXd& signal : signals) columns = std::max(columns, signal.cols());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(rows, columns);
  rows = 0;
  for (std::size_t s = 0; s < signals.size(); ++s) {
    const Stretch& stretch = (*stretches_)[s];
    const Eigen::MatrixXd& x = signals[s];
    // Many are zero but for a window.
    Eigen::Index begin = 0, end = x.rows();
    while (begin < end && x.row(begin).isZero(0.0)) ++begin;
    while (end > begin && x.row(end - 1).isZero(0.0)) --end;
    for (Eigen::Index k = 0; k < stretch.count && begin < end; ++k) {
      const Eigen::Index centre = stretch.filter.centre(stretch.first + k), reach = stretch.filter.reach();
      if (centre + reach >= begin && centre - reach < end)
        out.row(rows + k) = stretch.filter.output(stretch.first + k, x, 0, x.rows());
    }
    rows += stretch.count;
  }
  if (kept_.empty()) return out;
  return out(kept_, Eigen::all);
}

RowBlock GapRows::block(const Hypothesis& h, int unit, const Eigen::VectorXd& shape) const {
  RowBlock out;
  out.nominal = h.nominal(motions_->front().robot(), unit);
  std::vector<ColumnBlock> blocks(motions_->size());
  for (std::size_t s = 0; s < blocks.size(); ++s) {
    if (!used_[s]) continue;
    blocks[s] = h.columns((*motions_)[s], unit, shape);
    out.channels = blocks[s].channels;
    if (lateness_.size() == 0 || h.lateness(shape) != 0.0) continue;
    const Eigen::VectorXd& time = (*motions_)[s].t;
    for (std::size_t k = 0; k < out.channels.size(); ++k)
      for (auto column : blocks[s].values[k].colwise())
        column = interpolate(time, Eigen::VectorXd(column), time.array() - lateness_[out.channels[k]]);
  }
  for (std::size_t k = 0; k < out.channels.size(); ++k) {
    std::vector<Eigen::MatrixXd> signals(blocks.size());
    for (std::size_t s = 0; s < blocks.size(); ++s)
      if (used_[s]) signals[s] = std::move(blocks[s].values[k]);
    out.values.push_back(filtered(signals));
    if (moves_.size() > 0) out.values.back().array().colwise() *= moves_.col(out.channels[k]).array();
  }
  return out;
}

std::vector<ShapeParameter> GapRows::shape(const Hypothesis& h, int unit) const {
  if (h.scope() == Scope::arm || h.scope() == Scope::window) return h.shape();
  const int joint = h.scope() == Scope::pair ? pair_of(joints(), unit).first : unit;
  return h.shape_on(range[static_cast<std::size_t>(joint)].scale);
}

GapRows GapRows::late(const Eigen::VectorXd& lateness) const {
  GapRows out = *this;
  out.lateness_ = lateness;
  return out;
}

GapRows GapRows::moving(double times) const {
  constexpr Eigen::Index shortest = 3;  // rows: a reversal is shorter
  GapRows out = *this;
  // What the wider band has of speed beyond the motion's is what the sensor does not resolve.
  std::vector<Eigen::MatrixXd> beyond;
  for (const GapMotion& m : *motions_) beyond.push_back(m.speed - m.dq);
  Eigen::MatrixXd moves = Eigen::MatrixXd::Ones(size(), joints());
  for (int j = 0; j < joints(); ++j) {
    std::vector<double> noise;
    for (const Eigen::MatrixXd& x : beyond)
      for (const double v : x.col(j)) noise.push_back(std::abs(v));
    const auto middle = noise.begin() + static_cast<std::ptrdiff_t>(noise.size() / 2);
    std::nth_element(noise.begin(), middle, noise.end());
    const double slow = times * *middle / 0.6745;
    for (std::size_t p = 0; p + 1 < parts.size(); ++p) {
      Eigen::Index since = parts[p];
      for (Eigen::Index i = parts[p]; i <= parts[p + 1]; ++i) {
        if (i < parts[p + 1] && std::abs(dq(i, j)) < slow) continue;
        if (i - since >= shortest) moves.col(j).segment(since, i - since).setZero();
        since = i + 1;
      }
    }
    // A joint that hardly moves at all is not looked at in another way than before.
    if (moves.col(j).sum() < 0.2 * double(size())) moves.col(j).setOnes();
  }
  out.moves_ = moves;
  out.active = moves.colwise().sum().transpose();
  out.y = y.cwiseProduct(moves);
  out.timing = timing.cwiseProduct(moves);
  for (int j = 0; j < joints(); ++j)
    out.nuisance[static_cast<std::size_t>(j)].array().colwise() *= moves.col(j).array();
  return out;
}

void GapRows::make_nuisance() {
  const Robot& robot = motions_->front().robot();
  const int n = robot.size();
  for (int j = 0; j < n; ++j) {
    const JointFriction& f = robot.joints[static_cast<std::size_t>(j)].friction;
    std::vector<Eigen::MatrixXd> signals;
    for (const GapMotion& m : *motions_) {
      Eigen::MatrixXd columns(m.samples(), 10 * n + 6);
      for (int l = 0; l < n; ++l)
        columns.middleCols(10 * l, 10) =
            m.link_columns(l, j) * sizes(robot.joints[static_cast<std::size_t>(l)].parameters).asDiagonal();
      for (Eigen::Index i = 0; i < m.samples(); ++i) {
        const Eigen::RowVector3d linear = friction_regressor(f.linear, m.speed(i, j));
        const Eigen::RowVector3d sigmoid = friction_regressor(f.sigmoid, m.speed(i, j));
        columns.row(i).tail<6>() << linear[0] * f.linear.viscous, linear[1] * f.linear.coulomb,
            linear[2] * f.linear.offset, sigmoid[0] * f.sigmoid.phi1, sigmoid[1] * f.sigmoid.phi2,
            sigmoid[2] * f.sigmoid.phi3;
      }
      signals.push_back(columns);
    }
    const Eigen::MatrixXd all = filtered(signals);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(all.transpose() * all);
    const Eigen::Index count = std::min(directions, all.cols());
    nuisance.push_back(all * eigen.eigenvectors().rightCols(count));
  }
}

}  // namespace dynid::detail
