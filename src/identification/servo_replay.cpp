// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/identification/servo.hpp"

namespace dynid {
namespace {

double threshold(double r, double f) { return r > f ? r - f : r < -f ? r + f : 0.0; }

/// Joints coupled through the rigid body: one step of ServoState for all of them at once.
class CoupledServos {
 public:
  CoupledServos(const Robot& robot, const Log& log)
      : model_(robot), ws_(model_), n_(robot.size()), M_(n_, n_), tau_(n_), zero_(Eigen::VectorXd::Zero(n_)) {
    q = log.q.row(0).transpose();
    v = log.dq.size() > 0 ? Eigen::VectorXd(log.dq.row(0).transpose()) : zero_;
    filtered_ = log.u.row(0).transpose();
    w_ = v;
    for (int j = 0; j < n_; ++j) {
      joints_.push_back(servo_ratios(robot.joints[static_cast<std::size_t>(j)]));
      commands_.emplace_back(log.t, log.u.col(j));
    }
    hints_.assign(static_cast<std::size_t>(n_), 0);
    coupled_ =
        std::any_of(joints_.begin(), joints_.end(), [](const ServoJoint& j) { return j.compliance > 0.0; });
  }

  void step(double time, double h) {
    if (coupled_) {
      inverse_dynamics(model_, ws_, q, v, zero_, tau_);  // Coriolis and gravity torques
      mass_matrix(model_, ws_, q, M_);
    } else {
      M_.setZero();
      tau_.setZero();
    }
    Eigen::VectorXd r(n_), f(n_), kappa(n_), alpha(n_);
    for (int j = 0; j < n_; ++j) {
      const ServoJoint& p = joints_[static_cast<std::size_t>(j)];
      ServoInput in;
      commands_[static_cast<std::size_t>(j)].fill(time, h, p.delay, hints_[static_cast<std::size_t>(j)], in);
      if (p.command_lag > 0.0)
        filtered_[j] += h / (p.command_lag + h) * (in.command - filtered_[j]);
      else
        filtered_[j] = in.command;
      const double L = p.bias + p.compliance * tau_[j];
      double e = filtered_[j] - q[j];
      const bool saturated = std::abs(e) > p.limit;
      if (saturated) e = std::copysign(p.limit, e);
      kappa[j] = saturated ? 0.0 : 0.5 * h;
      const double x = v[j] / p.stribeck_velocity;
      f[j] = p.coulomb + (p.stribeck > 0.0 ? p.stribeck * std::exp(-x * x) : 0.0) +
             p.load_friction * std::abs(L);
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
  Eigen::VectorXd tau_, zero_, filtered_, w_;
  std::vector<ServoJoint> joints_;
  std::vector<HeldCommand> commands_;
  std::vector<Eigen::Index> hints_;
  bool coupled_ = false;
};

}  // namespace

ServoReplay replay_servos(const Robot& robot, const Log& log, int substeps) {
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
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < log.t.size(); ++i)
    if (log.t[i] > log.t[i - 1]) steps.push_back(log.t[i] - log.t[i - 1]);
  if (steps.empty()) throw Error(log.source + ": column t: the stamps do not advance");
  const double interval = median(std::move(steps));

  CoupledServos servos(robot, log);
  ServoReplay out;
  out.t = log.t;
  out.q.resize(log.samples(), n);
  out.dq.resize(log.samples(), n);
  for (Eigen::Index i = 0; i < log.samples(); ++i) {
    out.q.row(i) = servos.q.transpose();
    out.dq.row(i) = servos.v.transpose();
    if (i + 1 == log.samples()) break;
    const double span = log.t[i + 1] - log.t[i];
    if (!(span > 0.0)) continue;
    const int count = std::max(1, static_cast<int>(std::lround(substeps * span / interval)));
    for (int k = 0; k < count; ++k) servos.step(log.t[i] + k * span / count, span / count);
  }
  out.error = (out.q - log.q).cwiseAbs().colwise().mean().transpose();
  return out;
}

}  // namespace dynid
