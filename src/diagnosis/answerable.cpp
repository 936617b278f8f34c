// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/answerable.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/identification/predict.hpp"

namespace dynid {
namespace {

using Eigen::Index;

constexpr Index enough_rows = 4000;  // for what a joint carries: more only cost time

/// Every so many rows of all segments, one quantity after the other.
struct MotionRows {
  Eigen::MatrixXd q, dq, ddq;
};
MotionRows thinned(const std::vector<PreparedLog>& logs, int n) {
  Index rows = 0, at = 0;
  for (const PreparedLog& log : logs)
    for (const Segment& s : log.segments) rows += s.q.rows();
  const Index step = std::max<Index>(1, rows / enough_rows);
  MotionRows out;
  for (Eigen::MatrixXd* x : {&out.q, &out.dq, &out.ddq}) x->resize(rows / step + 1, n);
  Index seen = 0;
  for (const PreparedLog& log : logs)
    for (const Segment& s : log.segments)
      for (Index i = 0; i < s.q.rows(); ++i, ++seen) {
        if (seen % step != 0) continue;
        out.q.row(at) = s.q.row(i), out.dq.row(at) = s.dq.row(i), out.ddq.row(at) = s.ddq.row(i);
        ++at;
      }
  for (Eigen::MatrixXd* x : {&out.q, &out.dq, &out.ddq}) x->conservativeResize(at, Eigen::NoChange);
  return out;
}

int reversals_of(const std::vector<PreparedLog>& logs, int joint, double rest) {
  int count = 0;
  for (const PreparedLog& log : logs)
    for (const Segment& s : log.segments) {
      double way = 0.0;
      for (const double v : s.dq.col(joint)) {
        if (std::abs(v) < rest) continue;
        if (way * v < 0.0) ++count;
        way = v;
      }
    }
  return count;
}

/// 90 % over 10 % quantile of the speed of a joint in motion.
double spread_of(const Eigen::VectorXd& speed, double rest) {
  std::vector<double> moving;
  for (const double v : speed)
    if (std::abs(v) >= rest) moving.push_back(std::abs(v));
  if (moving.size() < 10) return 1.0;
  std::sort(moving.begin(), moving.end());
  return moving[moving.size() * 9 / 10] / std::max(moving[moving.size() / 10], 1e-300);
}

std::vector<std::string> channels_of(const std::vector<Log>& logs) {
  const std::pair<const char*, Eigen::MatrixXd Log::*> all[] = {
      {"q", &Log::q}, {"dq", &Log::dq},       {"tau", &Log::tau},         {"ddq", &Log::ddq},  {"u", &Log::u},
      {"i", &Log::i}, {"theta", &Log::theta}, {"tau_cmd", &Log::tau_cmd}, {"temp", &Log::temp}};
  std::vector<std::string> out;
  for (const auto& [name, member] : all)
    if (std::all_of(logs.begin(), logs.end(), [m = member](const Log& log) { return (log.*m).size() > 0; }))
      out.emplace_back(name);
  return out;
}

bool has(const std::vector<std::string>& list, const char* name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

/// `joint 2` or `joints 2 and 4`.
std::string of_joints(const std::vector<int>& list) {
  std::vector<std::string> parts;
  for (const int j : list) parts.push_back(std::to_string(j));
  return std::string(list.size() > 1 ? "joints " : "joint ") + list_in_words(parts);
}

/// What the joints' motion does not show.
void add_joints(const std::vector<std::pair<std::string, std::vector<int>>>& found, Answerable& out) {
  const std::pair<const char*, std::pair<const char*, const char*>> words[] = {
      {"joint_at_rest",
       {"hardly moves", "its friction, inertia and zero cannot be seen: let it move through its range"}},
      {"no_reversal",
       {"does not turn back",
        "friction is not told from an offset, and play and hysteresis do not show: move "
        "to and fro"}},
      {"one_speed",
       {"is always about as fast",
        "Coulomb and viscous friction are not told apart: move at several speeds"}},
      {"slow", {"stays below a tenth of its speed limit", "what grows with speed shows little: move faster"}},
      {"steady_load",
       {"carries about the same throughout",
        "what depends on the load (a gain of the torque, friction under "
        "load, a payload) is not told from an offset: vary its load"}}};
  for (const auto& [name, joints] : found) {
    if (joints.empty()) continue;
    for (const auto& [known, text] : words)
      if (name == known)
        out.blind.push_back({name, joints, of_joints(joints) + " " + text.first + ": " + text.second});
  }
}

void add_log(Answerable& out) {
  out.blind.push_back({"length",
                       {},
                       "what takes longer than some " + short_number(out.duration / 3.0, 2) +
                           " s (warming up) does not show in " + short_number(out.duration, 3) +
                           " s of log"});
  out.blind.push_back({"band",
                       {},
                       "what is quicker than " + short_number(out.band_hz, 2) + " Hz is not looked at; at " +
                           short_number(out.rate_hz, 3) + " Hz nothing above " +
                           short_number(0.5 * out.rate_hz, 3) + " Hz is in the log"});
  const std::pair<const char*, const char*> channels[] = {
      {"theta", "without positions of the motors, elasticity and play show through the torque alone"},
      {"tau_cmd", "without commanded torques, a drive at its limit is not told from a sensor at its"},
      {"temp", "without temperatures, a drift of friction is one with the clock or the motion"}};
  for (const auto& [name, text] : channels)
    if (!has(out.channels, name)) out.blind.push_back({"channel", {}, text});
}

}  // namespace

Answerable can_answer(const Robot& nominal, const std::vector<Log>& logs,
                      const std::vector<PreparedLog>& prepared, const AnswerableCriteria& criteria) {
  Answerable out;
  const int n = nominal.size();
  out.channels = channels_of(logs);
  out.rate_hz = prepared.empty() ? 0.0 : prepared.front().report.rate_hz;
  for (const PreparedLog& log : prepared) {
    out.duration += log.report.duration;
    out.rate_hz = std::min(out.rate_hz, log.report.rate_hz);
    out.band_hz = std::max(out.band_hz, log.cutoff);
  }
  const MotionRows rows = thinned(prepared, n);
  if (rows.q.rows() == 0) return out;
  Robot bare = nominal;
  for (Joint& joint : bare.joints) joint.friction = {};
  bare.effects.clear();
  const Eigen::MatrixXd tau = predict_torque(bare, rows.q, rows.dq, rows.ddq).tau;
  std::vector<int> resting, one_way, one_speed, slow, steady;
  for (int j = 0; j < n; ++j) {
    const JointLimits& limits = nominal.joints[static_cast<std::size_t>(j)].limits;
    const Eigen::VectorXd v = rows.dq.col(j), load = tau.col(j);
    JointExcitation e;
    e.travel = rows.q.col(j).maxCoeff() - rows.q.col(j).minCoeff();
    e.speed = v.cwiseAbs().maxCoeff();
    const double rest = criteria.at_rest * std::sqrt(v.squaredNorm() / double(v.size()));
    e.moving = rest > 0.0 ? double((v.array().abs() > rest).count()) / double(v.size()) : 0.0;
    e.reversals = rest > 0.0 ? reversals_of(prepared, j, rest) : 0;
    e.load = std::sqrt(load.squaredNorm() / double(load.size()));
    const Eigen::ArrayXd varying = load.array() - load.mean();
    e.swing = e.load > 0.0 ? std::sqrt(varying.square().mean()) / e.load : 0.0;
    out.joints.push_back(e);
    const double range = std::isfinite(limits.upper - limits.lower) ? limits.upper - limits.lower : 6.28;
    if (!(e.travel > criteria.least_travel * range)) {
      resting.push_back(j + 1);
      continue;  // what it does not do while at rest is no news
    }
    if (e.reversals < criteria.least_reversals)
      one_way.push_back(j + 1);
    else if (spread_of(v, rest) < criteria.least_spread)
      one_speed.push_back(j + 1);
    if (std::isfinite(limits.velocity) && e.speed < criteria.least_speed * limits.velocity)
      slow.push_back(j + 1);
    if (e.load > 0.0 && e.swing < criteria.least_swing) steady.push_back(j + 1);
  }
  add_joints({{"joint_at_rest", resting},
              {"no_reversal", one_way},
              {"one_speed", one_speed},
              {"slow", slow},
              {"steady_load", steady}},
             out);
  add_log(out);
  return out;
}

}  // namespace dynid
