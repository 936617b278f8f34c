// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/plant.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/detail/write.hpp"
#include "dynid/dynamics/forward_dynamics.hpp"
#include "effects/effect_model.hpp"
#include "rigid_body.hpp"

namespace dynid {

using detail::EffectModel;
using Eigen::VectorXd;

namespace {
// Steps of Runge-Kutta that cost as much as one implicit step.
constexpr int most_explicit_steps = 8;
}  // namespace

class Plant::Impl {
 public:
  Impl(const Robot& robot, const PlantOptions& options);

  void reset(const VectorXd& q, const VectorXd& dq, const VectorXd& tau);
  void step(const VectorXd& tau_cmd, double dt);
  void set_tip_wrench(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes);
  void effect_torques(Eigen::MatrixXd& torques);

  int n_;
  PlantOptions options_;
  Measurement measurement_;
  double t_ = 0.0, last_ = 0.0;
  VectorXd q_, dq_, ddq_, tau_;        // true, link side
  VectorXd theta_, dtheta_, ddtheta_;  // true, motor side
  VectorXd seen_q_, seen_dq_, seen_ddq_, seen_tau_;

 private:
  struct Spring {
    bool there;
    double stiffness, damping, gap, inertia;
  };
  struct Rates {
    VectorXd ddq, ddtheta;
  };

  /// Torque that joint j's spring passes on.
  double spring_torque(int j, double deflection, double rate) const noexcept;
  /// Fills tau_at_ (what the joints pass on), load_ (what takes it up but for M ddq), resisting_ (its part
  /// that depends on the velocity as friction does) and M_ for a state at time t under the drives' torque
  /// `drive`.
  void balance(double t, const VectorXd& drive, const VectorXd& q, const VectorXd& dq, const VectorXd& theta,
               const VectorXd& dtheta);
  /// The same, and the accelerations.
  void accelerations(double t, const VectorXd& drive, const VectorXd& q, const VectorXd& dq,
                     const VectorXd& theta, const VectorXd& dtheta, Rates& rates);
  void runge_kutta(double t, double h, double at_start, double at_end);
  /// A step of the two-stage, stiffly accurate, L-stable SDIRK method of order 2 (Alexander 1977): friction
  /// that jumps on a light joint is solved for, not followed.
  void implicit_step(double t, double h, double at_start, double at_end);
  /// One stage: the velocity dq = dq_base + g ddq, with q = q_base + g dq, that balances the torques at time
  /// t. `stage_` has the base on entry and the result on return, `rates` the accelerations.
  void solve_stage(double t, double g, Rates& rates);
  /// What is left of the balance at that velocity, into residual_; returns its size.
  double residual_at(double t, double g);
  /// Velocity of the motors that balances their springs, where there are any.
  void balance_motors(double g);
  struct Steps {
    int explicit_steps, implicit_steps;
  };
  /// Integration steps that the stiffest part of the plant needs in `h`.
  Steps substeps(double h);
  void update_mobility();
  void torque_of_drive(double part) {
    drive_ = from_ + part * (to_ - from_);
    for (EffectModel* model : limiting_) model->drive(drive_);
  }
  void see(bool first);
  void check_state() const;

  std::vector<Effect> effects_;
  std::vector<std::unique_ptr<EffectModel>> models_;
  std::vector<EffectModel*> acting_, limiting_;
  std::vector<std::size_t> sensors_;  // numbers of effects, in the order of their stages
  // bodies_[k]: the robot with the first k of its body-changing effects; the last one is the plant.
  std::vector<detail::WholeTorque> bodies_;
  std::vector<std::size_t> body_after_;  // of each effect: the body that it leaves
  std::unique_ptr<detail::RigidBody> body_;
  std::vector<JointFriction> friction_;
  std::vector<Spring> springs_;
  std::vector<detail::Transmission> transmission_;
  bool elastic_ = false;
  Eigen::MatrixXd inertia_;  // constant part of the mass matrix: rotors, coupled shafts
  VectorXd encoder_offset_;
  Eigen::Matrix<double, 6, 1> wrench_ = Eigen::Matrix<double, 6, 1>::Zero();
  bool pushed_ = false, tip_axes_ = false;

  // Scratch.
  VectorXd from_, to_, drive_, tau_at_, load_, x_, zero_, mobility_, damping_, stiffness_, near_;
  VectorXd q1_, dq1_, theta1_, dtheta1_, a_, b_, before_, resisting_, resisting_at_rest_, residual_;
  VectorXd q_base_, dq_base_, theta_base_, dtheta_base_, tangent_, secant_, dq_now_, change_;
  Eigen::MatrixXd M_, J_, sensed_, factors_;
  Rates k1_, k2_, k3_, k4_;
  std::vector<Eigen::Isometry3d> links_;
};

Plant::Impl::Impl(const Robot& robot, const PlantOptions& options)
    : n_(robot.size()), options_(options), measurement_(robot, options.measurement, options.seed) {
  validate(robot);
  if (!(options.integration_rate > 0.0) || !std::isfinite(options.integration_rate))
    throw Error("plant: the integration rate must be positive");
  Robot body = robot;
  body.effects.clear();
  bodies_.emplace_back(body);
  transmission_.resize(static_cast<std::size_t>(n_));
  inertia_ = Eigen::MatrixXd::Zero(n_, n_);
  encoder_offset_ = VectorXd::Zero(n_);
  for (const Effect& given : robot.effects) {
    effects_.push_back(complete_effect(given, robot));
    models_.push_back(detail::effect_definition(given.name).make(effects_.back(), robot));
    EffectModel& model = *models_.back();
    if (model.changes_body()) {
      const std::size_t broken = inconsistencies(body).size();
      model.change(body);
      const std::vector<Inconsistency> now = inconsistencies(body);
      if (now.size() > broken) throw Error("effect '" + given.name + "': " + describe(now.back()));
      bodies_.emplace_back(body);
    }
    body_after_.push_back(bodies_.size() - 1);
    model.add_inertia(inertia_);
    model.transmission(transmission_);
    model.add_encoder_offset(encoder_offset_);
    if (model.acts()) acting_.push_back(&model);
    if (model.limits_drives()) limiting_.push_back(&model);
    if (model.stage() != detail::SensorStage::none) sensors_.push_back(models_.size() - 1);
  }
  std::stable_sort(sensors_.begin(), sensors_.end(), [this](std::size_t a, std::size_t b) {
    return models_[a]->stage() < models_[b]->stage();
  });
  body_ = detail::RigidBody::make(body);
  friction_ = detail::smooth_friction(body);
  inertia_.diagonal() += detail::rotor_inertias(body);
  for (const detail::Transmission& t : transmission_) {
    Spring spring = {t.stiffness > 0.0, t.stiffness, 0.0, t.gap, t.motor_inertia};
    spring.damping = 2.0 * t.damping_ratio * std::sqrt(t.stiffness * t.motor_inertia);
    springs_.push_back(spring);
    elastic_ = elastic_ || spring.there;
  }
  for (VectorXd* v : {&q_,
                      &dq_,
                      &ddq_,
                      &tau_,
                      &theta_,
                      &dtheta_,
                      &ddtheta_,
                      &seen_q_,
                      &seen_dq_,
                      &seen_ddq_,
                      &seen_tau_,
                      &from_,
                      &to_,
                      &drive_,
                      &tau_at_,
                      &load_,
                      &x_,
                      &zero_,
                      &mobility_,
                      &damping_,
                      &stiffness_,
                      &near_,
                      &q1_,
                      &dq1_,
                      &theta1_,
                      &dtheta1_,
                      &a_,
                      &b_,
                      &before_,
                      &resisting_,
                      &resisting_at_rest_,
                      &residual_,
                      &q_base_,
                      &dq_base_,
                      &theta_base_,
                      &dtheta_base_,
                      &tangent_,
                      &secant_,
                      &dq_now_,
                      &change_})
    v->setZero(n_);
  for (Rates* k : {&k1_, &k2_, &k3_, &k4_}) k->ddq.setZero(n_), k->ddtheta.setZero(n_);
  M_.setZero(n_, n_);
  factors_.setZero(n_, n_);
  J_.setZero(6, n_);
  sensed_.setZero(n_, static_cast<Eigen::Index>(effects_.size()));
  links_.assign(static_cast<std::size_t>(n_) + 1, Eigen::Isometry3d::Identity());
  for (int j = 0; j < n_; ++j) {  // somewhere within its travel, where no axes coincide by construction
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    if (std::isfinite(limits.lower) && std::isfinite(limits.upper))
      q_[j] = limits.lower + (0.3 + 0.05 * j) * (limits.upper - limits.lower);
  }
  update_mobility();
  for (int j = 0; j < n_; ++j)
    if (!(mobility_[j] > 0.0) || !std::isfinite(mobility_[j]))
      throw Error("plant: joint " + std::to_string(j + 1) +
                  " carries no inertia: its link needs a mass, or the joint a rotor inertia");
  reset(zero_, zero_, zero_);
}

double Plant::Impl::spring_torque(int j, double deflection, double rate) const noexcept {
  const Spring& s = springs_[static_cast<std::size_t>(j)];
  const double half = 0.5 * s.gap;
  if (std::abs(deflection) <= half && s.gap > 0.0) return 0.0;
  const double pressed = deflection - std::copysign(half, deflection);
  const double torque = s.stiffness * pressed + s.damping * rate;
  // Flanks with play between them push; the damper cannot make them pull.
  return s.gap > 0.0 && torque * deflection < 0.0 ? 0.0 : torque;
}

void Plant::Impl::balance(double t, const VectorXd& drive, const VectorXd& q, const VectorXd& dq,
                          const VectorXd& theta, const VectorXd& dtheta) {
  tau_at_ = drive;
  if (elastic_) {
    for (int j = 0; j < n_; ++j)
      if (springs_[static_cast<std::size_t>(j)].there)
        tau_at_[j] = spring_torque(j, theta[j] - q[j], dtheta[j] - dq[j]);
  }
  bool posing = pushed_ && tip_axes_;
  for (const EffectModel* model : acting_) posing = posing || model->needs_poses(t);
  if (posing) body_->poses(q, links_);
  for (int j = 0; j < n_; ++j) resisting_[j] = friction_torque(friction_[static_cast<std::size_t>(j)], dq[j]);
  const detail::JointView view = {t, q, dq, tau_at_, links_};
  for (const EffectModel* model : acting_) model->add_torque(view, resisting_);
  body_->inverse(q, dq, zero_, load_);
  load_ += resisting_;
  if (pushed_) {
    Eigen::Matrix<double, 6, 1> wrench = wrench_;
    if (tip_axes_) {
      const auto axes = links_.back().linear();
      wrench.head<3>() = axes * wrench_.head<3>();
      wrench.tail<3>() = axes * wrench_.tail<3>();
    }
    body_->jacobian(q, J_);
    load_.noalias() -= J_.transpose() * wrench;
  }
  body_->mass(q, M_);
  M_ += inertia_;
}

void Plant::Impl::accelerations(double t, const VectorXd& drive, const VectorXd& q, const VectorXd& dq,
                                const VectorXd& theta, const VectorXd& dtheta, Rates& rates) {
  balance(t, drive, q, dq, theta, dtheta);
  rates.ddq = tau_at_ - load_;
  detail::solve_positive(detail::ElementMatrix<double>{M_.data(), n_}, n_, rates.ddq);
  if (!elastic_) return;
  for (int j = 0; j < n_; ++j) {
    const Spring& s = springs_[static_cast<std::size_t>(j)];
    rates.ddtheta[j] = s.there ? (drive[j] - tau_at_[j]) / s.inertia : rates.ddq[j];
  }
}

void Plant::Impl::runge_kutta(double t, double h, double at_start, double at_end) {
  // Hidden states go half a step before and half a step after (Strang): each keeps its own best integrator.
  for (EffectModel* model : acting_) model->advance(dq_, 0.5 * h);
  const auto stage = [&](const VectorXd& dq, const VectorXd& dtheta, const Rates& k, double part) {
    q1_ = q_ + part * dq;
    dq1_ = dq_ + part * k.ddq;
    if (!elastic_) return;
    theta1_ = theta_ + part * dtheta;
    dtheta1_ = dtheta_ + part * k.ddtheta;
  };
  torque_of_drive(at_start);
  accelerations(t, drive_, q_, dq_, theta_, dtheta_, k1_);
  torque_of_drive(0.5 * (at_start + at_end));
  stage(dq_, dtheta_, k1_, 0.5 * h);
  accelerations(t + 0.5 * h, drive_, q1_, dq1_, theta1_, dtheta1_, k2_);
  a_ = dq1_, b_ = dtheta1_;
  stage(a_, b_, k2_, 0.5 * h);
  accelerations(t + 0.5 * h, drive_, q1_, dq1_, theta1_, dtheta1_, k3_);
  a_ = dq1_, b_ = dtheta1_;
  torque_of_drive(at_end);
  stage(a_, b_, k3_, h);
  accelerations(t + h, drive_, q1_, dq1_, theta1_, dtheta1_, k4_);
  // Positions are twice integrals: sum of the stage velocities, dq + (h/2, h/2, h) k.
  q_ += h * dq_ + (h * h / 6.0) * (k1_.ddq + k2_.ddq + k3_.ddq);
  dq_ += (h / 6.0) * (k1_.ddq + 2.0 * k2_.ddq + 2.0 * k3_.ddq + k4_.ddq);
  if (elastic_) {
    theta_ += h * dtheta_ + (h * h / 6.0) * (k1_.ddtheta + k2_.ddtheta + k3_.ddtheta);
    dtheta_ += (h / 6.0) * (k1_.ddtheta + 2.0 * k2_.ddtheta + 2.0 * k3_.ddtheta + k4_.ddtheta);
  }
  for (EffectModel* model : acting_) model->advance(dq_, 0.5 * h);
}

void Plant::Impl::balance_motors(double g) {
  for (int j = 0; j < n_; ++j) {
    const Spring& s = springs_[static_cast<std::size_t>(j)];
    if (!s.there) continue;
    // Jm (dtheta - base) / g + torque(theta_base + g dtheta - q, dtheta - dq) = drive, increasing in dtheta:
    // on one flank, on the other, or between.
    const auto left = [&](double rate) {
      return s.inertia * (rate - dtheta_base_[j]) / g - drive_[j] +
             spring_torque(j, theta_base_[j] + g * rate - q1_[j], rate - dq1_[j]);
    };
    double best = dtheta_base_[j] + g * drive_[j] / s.inertia, least = std::abs(left(best));
    for (const double side : {1.0, -1.0}) {
      const double pressed = theta_base_[j] - q1_[j] - side * 0.5 * s.gap;
      const double rate =
          (s.inertia * dtheta_base_[j] / g + drive_[j] - s.stiffness * pressed + s.damping * dq1_[j]) /
          (s.inertia / g + s.stiffness * g + s.damping);
      if (const double size = std::abs(left(rate)); size < least) best = rate, least = size;
    }
    dtheta1_[j] = best;
    theta1_[j] = theta_base_[j] + g * best;
  }
}

double Plant::Impl::residual_at(double t, double g) {
  q1_ = q_base_ + g * dq1_;
  if (elastic_) balance_motors(g);
  balance(t, drive_, q1_, dq1_, theta1_, dtheta1_);
  change_ = (dq1_ - dq_base_) / g;
  residual_.noalias() = M_ * change_;
  residual_ += load_ - tau_at_;
  return (residual_.array().square() * mobility_.array()).sum();
}

void Plant::Impl::solve_stage(double t, double g, Rates& rates) {
  constexpr int most_iterations = 60;
  constexpr double exact = 1e-10;  // of the torques that balance
  // Resistance at rest, for the secants.
  a_ = dq1_;
  dq1_.setZero();
  residual_at(t, g);
  resisting_at_rest_ = resisting_;
  dq1_ = a_;
  double size = residual_at(t, g);
  for (int k = 0; k < most_iterations; ++k) {
    bool done = true;
    for (int j = 0; j < n_; ++j)
      done = done && std::abs(residual_[j]) <=
                         exact * (std::abs(tau_at_[j]) + std::abs(load_[j]) +
                                  M_(j, j) * (std::abs(change_[j]) +
                                              1e-6 / g * (std::abs(dq1_[j]) + std::abs(dq_base_[j]))));
    if (done) break;
    // Slopes of the resistance: the tangent's, and the secant's from rest. With the tangent this is Newton's
    // method, which a jump of the friction throws about; with the secant it creeps towards the solution from
    // one side (friction is concave in the speed), whatever the jump.
    tangent_.setZero();
    stiffness_.setZero();
    for (int j = 0; j < n_; ++j)
      tangent_[j] = std::abs(friction_slope(friction_[static_cast<std::size_t>(j)], dq1_[j]));
    for (const EffectModel* model : acting_) model->add_slopes(dq1_, tau_at_, tangent_, stiffness_);
    for (int j = 0; j < n_; ++j) {
      const Spring& s = springs_[static_cast<std::size_t>(j)];
      tangent_[j] += g * stiffness_[j];
      if (s.there) tangent_[j] += s.damping + g * s.stiffness;
      const double secant = (resisting_[j] - resisting_at_rest_[j]) / dq1_[j];
      secant_[j] = std::isfinite(secant) ? std::max(secant, tangent_[j]) : tangent_[j];
    }
    dq_now_ = dq1_;
    before_ = residual_;
    factors_ = M_ / g;
    b_ = before_;
    factors_.diagonal() += tangent_;
    detail::solve_positive(detail::ElementMatrix<double>{factors_.data(), n_}, n_, b_);
    dq1_ = dq_now_ - b_;
    factors_ = M_ / g;
    factors_.diagonal() += secant_;
    const double newton = residual_at(t, g);
    if (newton <= 0.25 * size) {
      size = newton;
      continue;
    }
    detail::solve_positive(detail::ElementMatrix<double>{factors_.data(), n_}, n_, before_);
    dq1_ = dq_now_ - before_;
    size = residual_at(t, g);
  }
  rates.ddq = change_;
  if (elastic_)
    for (int j = 0; j < n_; ++j)
      rates.ddtheta[j] =
          springs_[static_cast<std::size_t>(j)].there ? (dtheta1_[j] - dtheta_base_[j]) / g : change_[j];
}

void Plant::Impl::implicit_step(double t, double h, double at_start, double at_end) {
  constexpr double gamma = 1.0 - M_SQRT1_2;
  const double g = gamma * h;
  for (EffectModel* model : acting_) model->advance(dq_, 0.5 * h);
  q_base_ = q_, dq_base_ = dq_;
  theta_base_ = theta_, dtheta_base_ = dtheta_;
  torque_of_drive(at_start + gamma * (at_end - at_start));
  dq1_ = dq_ + g * ddq_;
  theta1_ = theta_, dtheta1_ = dtheta_;
  solve_stage(t + g, g, k1_);
  const double rest = h - g;
  q_base_ = q_ + rest * dq1_;
  dq_base_ = dq_ + rest * k1_.ddq;
  if (elastic_) {
    theta_base_ = theta_ + rest * dtheta1_;
    dtheta_base_ = dtheta_ + rest * k1_.ddtheta;
  }
  torque_of_drive(at_end);
  dq1_ += rest * k1_.ddq;
  solve_stage(t + h, g, k4_);
  q_ = q1_, dq_ = dq1_;
  if (elastic_) {
    for (int j = 0; j < n_; ++j) {
      if (!springs_[static_cast<std::size_t>(j)].there) continue;
      theta_[j] = theta1_[j], dtheta_[j] = dtheta1_[j];
    }
  }
  for (EffectModel* model : acting_) model->advance(dq_, 0.5 * h);
}

void Plant::Impl::update_mobility() {
  body_->mass(q_, M_);
  M_ += inertia_;
  const detail::ElementMatrix<double> factors{M_.data(), n_};
  for (int j = 0; j < n_; ++j) {  // diagonal of M^-1
    x_.setZero();
    x_[j] = 1.0;
    if (j == 0) {
      detail::solve_positive(factors, n_, x_);
    } else {  // it is U^T D U by now
      for (int i = j; i < n_; ++i)
        for (int k = i + 1; k < n_; ++k) x_[k] -= factors(i, k) * x_[i];
      for (int i = n_ - 1; i >= j; --i) {
        x_[i] /= factors(i, i);
        for (int k = i + 1; k < n_; ++k) x_[i] -= factors(i, k) * x_[k];
      }
    }
    mobility_[j] = x_[j];
  }
}

Plant::Impl::Steps Plant::Impl::substeps(double h) {
  damping_.setZero();
  stiffness_.setZero();
  // The velocity nearest to zero, where friction is steepest, that the step may see.
  for (int j = 0; j < n_; ++j)
    near_[j] = std::copysign(std::max(0.0, std::abs(dq_[j]) - 1.5 * h * std::abs(ddq_[j])), dq_[j]);
  for (int j = 0; j < n_; ++j)
    damping_[j] = std::abs(friction_slope(friction_[static_cast<std::size_t>(j)], near_[j]));
  for (const EffectModel* model : acting_) model->add_slopes(near_, tau_, damping_, stiffness_);
  double swings = 1.0, steps = 1.0;
  for (int j = 0; j < n_; ++j) {
    double rate = damping_[j] * mobility_[j], frequency = stiffness_[j] * mobility_[j];
    const Spring& s = springs_[static_cast<std::size_t>(j)];
    if (s.there) {
      const double both = mobility_[j] + 1.0 / s.inertia;
      rate += s.damping * both;
      frequency += s.stiffness * both;
    }
    swings = std::max(swings, std::sqrt(frequency) * h / 0.5);
    steps = std::max({steps, rate * h / 1.2, swings});
  }
  constexpr double most = 1000.0,
                   most_implicit = 100.0;  // the implicit method is stable beyond, if not exact
  return {static_cast<int>(std::min(std::ceil(steps), most)),
          static_cast<int>(std::min(std::ceil(swings), most_implicit))};
}

void Plant::Impl::check_state() const {
  if (q_.allFinite() && dq_.allFinite() && theta_.allFinite() && dtheta_.allFinite()) return;
  for (int j = 0; j < n_; ++j)
    if (!std::isfinite(q_[j]) || !std::isfinite(dq_[j]) || !std::isfinite(theta_[j] + dtheta_[j]))
      throw Error("plant: the motion of joint " + std::to_string(j + 1) + " is no longer finite at " +
                  std::to_string(t_) + " s");
}

void Plant::Impl::step(const VectorXd& tau_cmd, double dt) {
  if (!(dt > 0.0) || !std::isfinite(dt)) throw Error("plant: a step must be positive");
  if (tau_cmd.size() != n_ || !tau_cmd.allFinite())
    throw Error("plant: the torque command must be " + std::to_string(n_) + " finite numbers");
  from_ = options_.interpolate_torque ? to_ : tau_cmd;
  to_ = tau_cmd;
  update_mobility();
  const int steps = std::max(1, static_cast<int>(std::ceil(dt * options_.integration_rate - 1e-6)));
  const double h = dt / steps;
  for (int k = 0; k < steps; ++k) {
    const Steps needed = substeps(h);
    const bool stiff = needed.explicit_steps > most_explicit_steps * needed.implicit_steps;
    const int parts = stiff ? needed.implicit_steps : needed.explicit_steps;
    for (int i = 0; i < parts; ++i) {
      const double part = 1.0 / (double(steps) * parts), at = k / double(steps) + i * part;
      if (stiff)
        implicit_step(t_ + at * dt, h / parts, at, at + part);
      else
        runge_kutta(t_ + at * dt, h / parts, at, at + part);
    }
    ddq_ = k4_.ddq;  // of the last stage: good enough to choose the next step
  }
  t_ += dt;
  check_state();
  see(false);
}

void Plant::Impl::reset(const VectorXd& q, const VectorXd& dq, const VectorXd& tau) {
  for (const VectorXd* v : {&q, &dq, &tau})
    if (v->size() != n_ || !v->allFinite())
      throw Error("plant: position, velocity and torque must be " + std::to_string(n_) + " finite numbers");
  t_ = 0.0;
  theta_ = q + encoder_offset_;
  dtheta_ = dq;
  q_ = theta_;
  dq_ = dq;
  from_ = to_ = tau;
  for (int j = 0; j < n_; ++j) {
    const Spring& s = springs_[static_cast<std::size_t>(j)];
    if (s.there && tau[j] != 0.0) q_[j] -= tau[j] / s.stiffness + std::copysign(0.5 * s.gap, tau[j]);
  }
  for (const auto& model : models_) model->reset();
  see(true);
}

void Plant::Impl::see(bool first) {
  torque_of_drive(1.0);
  accelerations(t_, drive_, q_, dq_, theta_, dtheta_, k1_);
  ddq_ = k1_.ddq;
  tau_ = tau_at_;
  for (int j = 0; j < n_; ++j) {
    const bool spring = springs_[static_cast<std::size_t>(j)].there;
    if (!spring) theta_[j] = q_[j], dtheta_[j] = dq_[j];
    ddtheta_[j] = spring ? k1_.ddtheta[j] : ddq_[j];
  }
  seen_q_ = theta_ - encoder_offset_;
  seen_dq_ = dtheta_;
  seen_ddq_ = ddtheta_;
  seen_tau_ = tau_;
  for (const std::size_t k : sensors_) {
    EffectModel& sensor = *models_[k];
    before_ = seen_tau_;
    if (first) sensor.reset_sensor(t_, seen_tau_);
    if (!first || sensor.stage() != detail::SensorStage::delay) sensor.sense(t_, seen_tau_);
    sensed_.col(static_cast<Eigen::Index>(k)) = seen_tau_ - before_;
  }
  if (first) {
    measurement_.reset(seen_q_, seen_dq_, seen_tau_);
  } else {
    measurement_.update(seen_q_, seen_dq_, seen_tau_, t_ - last_);
  }
  last_ = t_;
}

void Plant::Impl::set_tip_wrench(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes) {
  if (!wrench.allFinite()) throw Error("plant: the wrench on the tip is not finite");
  wrench_ = wrench;
  tip_axes_ = tip_axes;
  pushed_ = !wrench.isZero(0.0);
}

void Plant::Impl::effect_torques(Eigen::MatrixXd& torques) {
  torques.setZero(n_, static_cast<Eigen::Index>(effects_.size()));
  // From the motion seen to the true one, an effect at a time, each seen by the final body.
  q1_ = seen_q_, dq1_ = seen_dq_, x_ = seen_ddq_;
  near_.setZero();
  detail::WholeTorque& body = bodies_.back();
  const bool posing = std::any_of(acting_.begin(), acting_.end(),
                                  [this](const EffectModel* model) { return model->needs_poses(t_); });
  if (posing) body_->poses(q_, links_);
  const detail::JointView view = {t_, q_, dq_, tau_, links_};
  body(q1_, dq1_, x_, before_);
  for (std::size_t k = 0; k < effects_.size(); ++k) {
    const EffectModel& model = *models_[k];
    auto torque = torques.col(static_cast<Eigen::Index>(k));
    torque = sensed_.col(static_cast<Eigen::Index>(k));
    if (model.changes_body()) {
      bodies_[body_after_[k]](seen_q_, seen_dq_, seen_ddq_, a_);
      bodies_[body_after_[k] - 1](seen_q_, seen_dq_, seen_ddq_, b_);
      torque += a_ - b_;
    }
    M_.setZero();
    model.add_inertia(M_);
    a_.noalias() = M_ * ddq_;
    if (model.acts()) model.add_torque(view, a_);
    torque += a_;
    a_ = q1_;
    model.add_encoder_offset(a_);
    bool moved = !(a_.array() == q1_.array()).all();
    q1_ = a_;
    std::fill(transmission_.begin(), transmission_.end(), detail::Transmission());
    model.transmission(transmission_);
    for (int j = 0; j < n_; ++j) {
      if (!(transmission_[static_cast<std::size_t>(j)].stiffness > 0.0) || near_[j] != 0.0) continue;
      near_[j] = 1.0;  // the first of two springs in one joint is given both their shares
      q1_[j] += q_[j] - theta_[j];
      dq1_[j] = dq_[j], x_[j] = ddq_[j];
      moved = true;
    }
    if (!moved) continue;
    body(q1_, dq1_, x_, a_);
    torque += a_ - before_;
    before_ = a_;
  }
}

// ------------------------------------------------------------------------------------------------- interface

Plant::Plant(const Robot& robot, const PlantOptions& options)
    : impl_(std::make_unique<Impl>(robot, options)) {}
Plant::~Plant() = default;
Plant::Plant(Plant&&) noexcept = default;
Plant& Plant::operator=(Plant&&) noexcept = default;

int Plant::size() const noexcept { return impl_->n_; }
void Plant::reset(const VectorXd& q, const VectorXd& dq, const VectorXd& tau) { impl_->reset(q, dq, tau); }
void Plant::reset(const VectorXd& q, const VectorXd& dq) { reset(q, dq, VectorXd::Zero(size())); }
void Plant::step(const VectorXd& tau_cmd, double dt) { impl_->step(tau_cmd, dt); }
void Plant::set_tip_wrench(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes) {
  impl_->set_tip_wrench(wrench, tip_axes);
}
double Plant::time() const noexcept { return impl_->t_; }
const VectorXd& Plant::q() const noexcept { return impl_->q_; }
const VectorXd& Plant::dq() const noexcept { return impl_->dq_; }
const VectorXd& Plant::ddq() const noexcept { return impl_->ddq_; }
const VectorXd& Plant::tau() const noexcept { return impl_->tau_; }
const VectorXd& Plant::seen_q() const noexcept { return impl_->seen_q_; }
const VectorXd& Plant::seen_dq() const noexcept { return impl_->seen_dq_; }
const VectorXd& Plant::seen_ddq() const noexcept { return impl_->seen_ddq_; }
const VectorXd& Plant::seen_tau() const noexcept { return impl_->seen_tau_; }
const VectorXd& Plant::measured_q() const noexcept { return impl_->measurement_.q(); }
const VectorXd& Plant::measured_dq() const noexcept { return impl_->measurement_.dq(); }
const VectorXd& Plant::measured_tau() const noexcept { return impl_->measurement_.tau(); }
void Plant::effect_torques(Eigen::MatrixXd& torques) { impl_->effect_torques(torques); }

}  // namespace dynid
