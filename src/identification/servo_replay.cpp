// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/identification/servo_rollout.hpp"
#include "servo_data.hpp"

namespace dynid {
namespace {

double threshold(double r, double f) { return r > f ? r - f : r < -f ? r + f : 0.0; }

/// Joints coupled through the rigid body: one step of ServoState for all of them at once.
class CoupledServos {
 public:
  CoupledServos(const Robot& robot, const Log& log)
      : model_(robot),
        ws_(model_),
        n_(robot.size()),
        M_(n_, n_),
        tau_(n_),
        gravity_(Eigen::VectorXd::Zero(n_)),
        zero_(Eigen::VectorXd::Zero(n_)) {
    for (int j = 0; j < n_; ++j) {
      joints_.push_back(detail::servo_joint(robot, j));
      commands_.emplace_back(log.t, log.u.col(j));
      compensated_ = compensated_ || joints_.back().gravity_compensation != 0.0;
    }
    hints_.assign(static_cast<std::size_t>(n_), 0);
    coupled_ =
        std::any_of(joints_.begin(), joints_.end(), [](const ServoJoint& j) { return j.compliance > 0.0; });
    start(log.q.row(0).transpose(), log.dq.size() > 0 ? Eigen::VectorXd(log.dq.row(0).transpose()) : zero_,
          log.t[0]);
  }

  /// From a state at `time`; filters have settled on the commands that have come by then.
  void start(const Eigen::VectorXd& q0, const Eigen::VectorXd& v0, double time) {
    q = q0;
    v = w_ = v0;
    filtered_.resize(n_);
    for (int j = 0; j < n_; ++j) {
      const auto k = static_cast<std::size_t>(j);
      filtered_[j] = commands_[k].at(time - joints_[k].delay, hints_[k]);
    }
  }

  void step(double time, double h) {
    if (coupled_) {
      inverse_dynamics(model_, ws_, q, v, zero_, tau_);  // Coriolis and gravity torques
      mass_matrix(model_, ws_, q, M_);
      if (compensated_) gravity(model_, ws_, q, gravity_);
    } else {
      M_.setZero();
      tau_.setZero();
    }
    Eigen::VectorXd r(n_), f(n_), kappa(n_), alpha(n_);
    for (int j = 0; j < n_; ++j) {
      const ServoJoint& p = joints_[static_cast<std::size_t>(j)];
      ServoInput in;
      commands_[static_cast<std::size_t>(j)].fill(time, h, p.delay, hints_[static_cast<std::size_t>(j)], in);
      filtered_[j] += h / (p.command_lag + h) * (in.command - filtered_[j]);
      const double L =
          p.bias + p.spring * q[j] + p.compliance * (tau_[j] - p.gravity_compensation * gravity_[j]);
      double e = behind_gap(filtered_[j] - q[j], p.backlash);
      const bool idle = p.backlash > 0.0 && e == 0.0, saturated = std::abs(e) > p.limit;
      if (saturated) e = std::copysign(p.limit, e);
      kappa[j] = 0.5 * h * ((saturated || idle ? 0.0 : 1.0) + p.spring);
      const double x = v[j] / p.stribeck_velocity;
      f[j] = p.coulomb + (p.stribeck > 0.0 ? p.stribeck * std::exp(-x * x) : 0.0) +
             p.load_friction *
                 std::abs(e + p.compliance * p.gravity_compensation * gravity_[j] - p.damping * v[j]);
      r[j] = e - L;
      alpha[j] = inertia(j) > 0.5 * p.damping * h ? 2.0 : 1.0;
    }
    solve(h, r, f, kappa, alpha);
    bool again = false;
    for (int j = 0; j < n_; ++j) {
      if (alpha[j] != 2.0) continue;
      const double next = 2.0 * w_[j] - v[j];
      if (w_[j] == 0.0 || next * w_[j] < 0.0 || next * v[j] < 0.0) alpha[j] = 1.0, again = true;
    }
    if (again) solve(h, r, f, kappa, alpha);
    for (int j = 0; j < n_; ++j) {
      q[j] += h * w_[j];
      v[j] = alpha[j] == 2.0 ? 2.0 * w_[j] - v[j] : w_[j];
    }
  }

  Eigen::VectorXd q, v;

 private:
  double inertia(int j) const {
    const ServoJoint& p = joints_[static_cast<std::size_t>(j)];
    return p.inertia + p.compliance * M_(j, j);
  }

  /// Velocities of the step. The friction makes it a complementarity problem with a positive definite matrix,
  /// on which the sweeps converge; a joint alone takes one.
  void solve(double h, const Eigen::VectorXd& r, const Eigen::VectorXd& f, const Eigen::VectorXd& kappa,
             const Eigen::VectorXd& alpha) {
    constexpr int most_sweeps = 50;
    constexpr double enough = 1e-10;  // of the largest velocity
    for (int sweep = 0; sweep < most_sweeps; ++sweep) {
      double change = 0.0;
      for (int j = 0; j < n_; ++j) {
        const ServoJoint& p = joints_[static_cast<std::size_t>(j)];
        const double a = inertia(j);
        double R = alpha[j] * a * v[j] / h + r[j];
        if (p.compliance > 0.0)
          for (int k = 0; k < n_; ++k)
            if (k != j) R -= p.compliance * M_(j, k) * alpha[k] * (w_[k] - v[k]) / h;
        const double w = threshold(R, f[j]) / (alpha[j] * a / h + p.damping + kappa[j]);
        change = std::max(change, std::abs(w - w_[j]));
        w_[j] = w;
      }
      if (!coupled_ || change <= enough * w_.cwiseAbs().maxCoeff()) break;
    }
  }

  Model<> model_;
  Workspace<> ws_;
  int n_;
  Eigen::MatrixXd M_;
  Eigen::VectorXd tau_, gravity_, zero_, filtered_, w_;
  std::vector<ServoJoint> joints_;
  std::vector<HeldCommand> commands_;
  std::vector<Eigen::Index> hints_;
  bool coupled_ = false, compensated_ = false;
};

void check_replay(const Robot& robot, const Log& log) {
  validate(robot);
  const int n = robot.size();
  for (const Joint& joint : robot.joints)
    if (!joint.servo)
      throw Error("robot '" + robot.name + "': joint '" + joint.name +
                  "' has no servo: a replay needs one on every joint (dynid identify --servo)");
  if (log.u.size() == 0)
    throw Error(log.source + ": columns u1..u" + std::to_string(n) + " are missing: a replay needs commands");
  if (log.u.cols() != n || log.q.cols() != n || log.t.size() != log.q.rows() || log.samples() < 2)
    throw Error(log.source + ": has " + std::to_string(log.joints()) + " joints, the model has " +
                std::to_string(n));
}

double median_step(const Log& log) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < log.t.size(); ++i)
    if (log.t[i] > log.t[i - 1]) steps.push_back(log.t[i] - log.t[i - 1]);
  if (steps.empty()) throw Error(log.source + ": column t: the stamps do not advance");
  return median(std::move(steps));
}

/// From one stamp to the next.
void advance(CoupledServos& servos, const Log& log, Eigen::Index i, double interval, int substeps) {
  const double span = log.t[i + 1] - log.t[i];
  if (!(span > 0.0)) return;
  const int count = std::max(1, static_cast<int>(std::lround(substeps * span / interval)));
  for (int k = 0; k < count; ++k) servos.step(log.t[i] + k * span / count, span / count);
}

}  // namespace

ServoReplay replay_servos(const Robot& robot, const Log& log, int substeps) {
  check_replay(robot, log);
  const double interval = median_step(log);
  CoupledServos servos(robot, log);
  ServoReplay out;
  out.t = log.t;
  out.q.resize(log.samples(), robot.size());
  out.dq.resize(log.samples(), robot.size());
  for (Eigen::Index i = 0; i < log.samples(); ++i) {
    out.q.row(i) = servos.q.transpose();
    out.dq.row(i) = servos.v.transpose();
    if (i + 1 < log.samples()) advance(servos, log, i, interval, substeps);
  }
  out.error = (out.q - log.q).cwiseAbs().colwise().mean().transpose();
  return out;
}

Eigen::MatrixXd replay_servos_from(const Robot& robot, const Log& log, const Eigen::MatrixXd& dq,
                                   const std::vector<Eigen::Index>& starts, int substeps) {
  check_replay(robot, log);
  const double interval = median_step(log);
  CoupledServos servos(robot, log);
  Eigen::MatrixXd q = log.q;
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < log.samples(); ++i) {
    if (next < starts.size() && starts[next] == i) {
      servos.start(log.q.row(i).transpose(), dq.row(i).transpose(), log.t[i]);
      ++next;
    }
    if (next == 0) continue;
    q.row(i) = servos.q.transpose();
    if (i + 1 < log.samples()) advance(servos, log, i, interval, substeps);
  }
  return q;
}

}  // namespace dynid
