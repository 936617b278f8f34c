// SPDX-License-Identifier: Apache-2.0
#include "servo_data.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/effect/complete.hpp"
#include "dynid/signal/filter.hpp"

namespace dynid::detail {
namespace {

constexpr double degrees = 180.0 / M_PI;

double median_interval(const Eigen::VectorXd& t) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) steps.push_back(t[i] - t[i - 1]);
  return median(std::move(steps));
}

double spread(const Eigen::Ref<const Eigen::VectorXd>& x) { return x.maxCoeff() - x.minCoeff(); }

std::string three_digits(double value) { return dynid::short_number(value, 3); }

/// A factor of 57.3, give or take what a servo that follows badly makes of it.
bool is_degrees(double ratio) { return ratio > degrees / 2.0 && ratio < degrees * 2.0; }

struct RigidBody {
  Eigen::MatrixXd inertia, load, gravity;  // N x n
};

/// Along the measured motion: the accelerations of the other joints are needed.
RigidBody along(const Robot& robot, const Log& log, double interval) {
  const int n = robot.size();
  const SmoothMotion m = smooth_motion(log, interval);
  const Eigen::Index size = m.t.size();
  const Model<> model(robot);
  Workspace<> ws(model);
  Eigen::MatrixXd inertia(size, n), load(size, n), weight(size, n), M(n, n);
  Eigen::VectorXd tau(n), g(n);
  for (Eigen::Index i = 0; i < size; ++i) {
    inverse_dynamics(model, ws, m.q.row(i).transpose(), m.v.row(i).transpose(), m.a.row(i).transpose(), tau);
    mass_matrix(model, ws, m.q.row(i).transpose(), M);
    gravity(model, ws, m.q.row(i).transpose(), g);
    weight.row(i) = g.transpose();
    inertia.row(i) = M.diagonal().transpose();
    load.row(i) = tau.transpose() - inertia.row(i).cwiseProduct(m.a.row(i));
  }
  RigidBody out;
  out.inertia.resize(log.t.size(), n);
  out.load = out.gravity = out.inertia;
  for (int j = 0; j < n; ++j) {
    out.inertia.col(j) = interpolate(m.t, inertia.col(j), log.t);
    out.load.col(j) = interpolate(m.t, load.col(j), log.t);
    out.gravity.col(j) = interpolate(m.t, weight.col(j), log.t);
  }
  return out;
}

void check_units(const std::vector<Log>& logs, const std::optional<Robot>& robot, int joint) {
  for (const Log& log : logs) {
    const std::string where = log.source + ": joint " + std::to_string(joint + 1) + ": ";
    const double u = spread(log.u.col(joint)), q = spread(log.q.col(joint));
    if (q > 0.0 && u > 0.0 && is_degrees(u / q) && log.u.col(joint).cwiseAbs().maxCoeff() > 2.0 * M_PI)
      throw Error(where + "the commands u move " + three_digits(u / q) +
                  " times as far as the positions q: they are in degrees, radians are expected");
    if (q > 0.0 && u > 0.0 && is_degrees(q / u) && log.q.col(joint).cwiseAbs().maxCoeff() > 2.0 * M_PI)
      throw Error(where + "the positions q move " + three_digits(q / u) +
                  " times as far as the commands u: they are in degrees, radians are expected");
    if (!robot || robot->joints[static_cast<std::size_t>(joint)].type != JointType::revolute) continue;
    const JointLimits& limits = robot->joints[static_cast<std::size_t>(joint)].limits;
    const double reach = std::max(std::abs(limits.lower), std::abs(limits.upper));
    const double most = log.q.col(joint).cwiseAbs().maxCoeff();
    if (std::isfinite(reach) && reach > 0.0 && most > 4.0 * reach && most <= degrees * reach * 1.1)
      throw Error(where + "the positions reach " + three_digits(most) + ", " + three_digits(most / reach) +
                  " times the joint's limit: they are in degrees, radians are expected");
  }
}

}  // namespace

void check_servo_logs(const std::vector<Log>& logs, const std::optional<Robot>& robot,
                      std::vector<DataIssue>& issues) {
  constexpr Eigen::Index fewest = 100;  // samples: some ten for each parameter
  if (logs.empty()) throw Error("no log to identify servos from");
  const int n = robot ? robot->size() : logs.front().joints();
  for (const Log& log : logs) {
    if (log.u.size() == 0)
      throw Error(log.source + ": columns u1..u" + std::to_string(n) +
                  " are missing: servos are identified from commanded positions");
    if (log.q.rows() != log.u.rows() || log.q.cols() != n || log.u.cols() != n ||
        log.t.size() != log.q.rows())
      throw Error(log.source + ": has " + std::to_string(log.joints()) + " joints and " +
                  std::to_string(log.u.cols()) + " commands, expected " + std::to_string(n) + " of each");
    if (log.samples() < fewest)
      throw Error(log.source + ": " + std::to_string(log.samples()) + " samples: at least " +
                  std::to_string(fewest) + " are needed");
    if (!log.q.allFinite() || !log.u.allFinite() || !log.t.allFinite())
      throw Error(log.source + ": a stamp, command or position is not finite");
    const double interval = median_interval(log.t);
    if (!(interval > 0.0)) throw Error(log.source + ": column t: the stamps do not advance");
    double longest = 0.0;
    Eigen::Index repeats = 0;
    for (Eigen::Index i = 1; i < log.t.size(); ++i) {
      longest = std::max(longest, log.t[i] - log.t[i - 1]);
      if (log.t[i] == log.t[i - 1]) ++repeats;
    }
    if (longest > 3.0 * interval)
      issues.push_back({"gaps",
                        {},
                        longest,
                        "s",
                        log.source + ": the longest interval is " + three_digits(longest) +
                            " s, the median " + three_digits(interval) +
                            " s: the last command is held across it"});
    if (repeats > 0)
      issues.push_back({"repeated_rows",
                        {},
                        double(repeats),
                        "rows",
                        log.source + ": " + std::to_string(repeats) + " rows repeat a stamp"});
    if (robot)
      for (int j = 0; j < n; ++j) {
        const JointLimits& limits = robot->joints[static_cast<std::size_t>(j)].limits;
        const double margin = 0.01 * (limits.upper - limits.lower);
        const auto beyond =
            ((log.u.col(j).array() > limits.upper + margin) || (log.u.col(j).array() < limits.lower - margin))
                .count();
        if (beyond > 0)
          issues.push_back(
              {"saturation",
               {j + 1},
               double(beyond) / double(log.samples()),
               "share",
               log.source + ": joint " + std::to_string(j + 1) +
                   ": commands beyond the joint's limits: an end stop would be fitted as friction"});
      }
  }
  for (int j = 0; j < n; ++j) check_units(logs, robot, j);
}

SmoothMotion smooth_motion(const Log& log, double interval) {
  const auto n = log.q.cols();
  std::vector<Eigen::Index> fresh = {0};
  for (Eigen::Index i = 1; i < log.t.size(); ++i)
    if (log.t[i] > log.t[fresh.back()]) fresh.push_back(i);
  const auto count = static_cast<Eigen::Index>(fresh.size());
  Eigen::VectorXd t(count);
  Eigen::MatrixXd q(count, n);
  for (Eigen::Index i = 0; i < count; ++i) {
    t[i] = log.t[fresh[static_cast<std::size_t>(i)]];
    q.row(i) = log.q.row(fresh[static_cast<std::size_t>(i)]);
  }
  const double rate = 1.0 / interval;
  const auto size = std::max<Eigen::Index>(3, static_cast<Eigen::Index>((t[count - 1] - t[0]) * rate) + 1);
  SmoothMotion out;
  out.t = Eigen::VectorXd::LinSpaced(size, t[0], t[count - 1]);
  const double grid_rate = double(size - 1) / (t[count - 1] - t[0]);
  out.q.resize(size, n);
  for (Eigen::Index j = 0; j < n; ++j) out.q.col(j) = interpolate(t, q.col(j), out.t);
  ZeroPhaseButterworth(grid_rate / 6.0, grid_rate).apply(out.q);
  out.v = differentiate(out.q, grid_rate);
  out.a = differentiate(out.v, grid_rate);
  return out;
}

std::vector<std::vector<ServoSeries>> servo_series(const std::vector<Log>& logs,
                                                   const std::optional<Robot>& robot) {
  const int n = logs.front().joints();
  std::vector<std::vector<ServoSeries>> out(static_cast<std::size_t>(n));
  int number_of_log = 0;
  for (const Log& log : logs) {
    const double interval = median_interval(log.t);
    RigidBody body;
    if (robot) body = along(*robot, log, interval);
    for (int j = 0; j < n; ++j) {
      ServoSeries s(log.t, log.u.col(j), log.q.col(j));
      s.interval = interval;
      s.log = number_of_log;
      if (log.dq.size() > 0) s.v0 = log.dq(0, j);
      double step = std::numeric_limits<double>::infinity();
      for (Eigen::Index i = 1; i < s.q.size(); ++i) {
        const double change = std::abs(s.q[i] - s.q[i - 1]);
        if (change > 0.0) step = std::min(step, change);
      }
      s.resolution = std::isfinite(step) ? step : 0.0;
      if (robot) {
        s.inertia = body.inertia.col(j);
        s.load = body.load.col(j);
        s.gravity = body.gravity.col(j);
      }
      out[static_cast<std::size_t>(j)].push_back(std::move(s));
    }
    ++number_of_log;
  }
  return out;
}

ServoJoint servo_joint(const Robot& robot, int joint) {
  ServoJoint out = servo_ratios(robot.joints[static_cast<std::size_t>(joint)]);
  for (const Effect& effect : robot.effects) {
    const bool here = std::find(effect.joints.begin(), effect.joints.end(), joint + 1) != effect.joints.end();
    if (effect.name == "backlash" && here)
      if (const auto gap = effect.parameters.find("gap"); gap != effect.parameters.end())
        out.backlash += 0.5 * gap->second[static_cast<std::size_t>(joint)];
    if (!(out.compliance > 0.0)) continue;
    if (effect.name != "joint_spring") continue;
    LoopTerms terms(robot.size());
    effect_schema(effect.name).compile(terms, checked_effect(effect, robot));
    out.spring += out.compliance * terms.stiffness[joint];
    out.bias += out.compliance * terms.offset[joint];
  }
  return out;
}

ServoSeries part_of(const ServoSeries& s, Eigen::Index first, Eigen::Index count) {
  ServoSeries part(s.t.segment(first, count), s.u.segment(first, count), s.q.segment(first, count));
  part.interval = s.interval;
  part.resolution = s.resolution;
  part.log = s.log;
  if (first == 0) part.v0 = s.v0;
  if (s.load.size() > 0) {
    part.inertia = s.inertia.segment(first, count);
    part.load = s.load.segment(first, count);
    part.gravity = s.gravity.segment(first, count);
    if (s.parts.rows() > 0) part.parts = s.parts.middleRows(first, count);
  }
  return part;
}

}  // namespace dynid::detail
