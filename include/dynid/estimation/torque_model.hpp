// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/estimation/momentum.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {

/// What a TorqueModel does with an effect that the loop cannot compute.
enum class Uncompensated {
  refuse,  ///< throws Error `effect 'x' cannot run in the loop: it depends on ...`
  ignore,  ///< leaves it out; uncompensated_effects() names it
};

namespace detail {

/// At most `Most` of T without allocation, any number where Most is Eigen::Dynamic.
template <class T, int Most>
class TermList {
 public:
  explicit TermList(const std::vector<T>& terms = {}) {
    if constexpr (Most == Eigen::Dynamic) {
      terms_ = terms;
    } else {
      if (terms.size() > terms_.size())
        throw Error("the model has " + std::to_string(terms.size()) +
                    " terms of one kind of effect, the loop has room for " + std::to_string(terms_.size()));
      std::copy(terms.begin(), terms.end(), terms_.begin());
    }
    count_ = terms.size();
  }
  const T* begin() const noexcept { return terms_.data(); }
  const T* end() const noexcept { return terms_.data() + count_; }
  bool empty() const noexcept { return count_ == 0; }

 private:
  std::conditional_t<Most == Eigen::Dynamic, std::vector<T>,
                     std::array<T, Most == Eigen::Dynamic ? 1 : static_cast<std::size_t>(Most)>>
      terms_;
  std::size_t count_ = 0;
};

/// A robot for the loop: effects that can enter it entered, the others compiled.
struct LoopRobot {
  LoopRobot(const Robot& given, Uncompensated uncompensated) : robot(given), terms(given.size()) {
    robot.effects.clear();
    for (const Effect& effect : given.effects) {
      const EffectSchema& schema = effect_schema(effect.name);
      if (!schema.in_loop()) {
        if (uncompensated == Uncompensated::ignore) continue;
        throw Error("effect '" + effect.name + "' cannot run in the loop: it depends on " +
                    schema.not_in_loop);
      }
      if (!enter_effect(robot, effect, Entering::everything))
        schema.compile(terms, checked_effect(effect, given));
    }
  }
  Robot robot;
  LoopTerms terms;
};

}  // namespace detail

/// All that a model says of the joint torque, compiled for the loop: rigid body, rotor inertia, friction of
/// eqs. (24) and (25), a payload, and of Robot::effects those that are functions of q, dq and ddq. Which
/// these are, EffectSchema::in_loop() says.
///
/// For a fixed N a copy is a plain copy, without allocation. The constructor throws Error.
template <int N = Eigen::Dynamic>
class TorqueModel {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// Throws Error where Model does, on friction or limits that are not numbers, where checked_effect() does,
  /// and on an effect that the loop cannot compute, unless it is to be ignored.
  explicit TorqueModel(const Robot& robot, Uncompensated uncompensated = Uncompensated::refuse)
      : TorqueModel(detail::LoopRobot(robot, uncompensated)) {}

  int size() const noexcept { return model_.size(); }
  const Model<N>& rigid_body() const noexcept { return model_; }
  const Vector& rotor_inertia() const noexcept { return rotor_; }  ///< Ia [kg m^2], n
  // Limits, n each: [rad], [rad], [rad/s], [N m]; infinite where unknown.
  const Vector& lower() const noexcept { return lower_; }
  const Vector& upper() const noexcept { return upper_; }
  const Vector& velocity_limit() const noexcept { return velocity_; }
  const Vector& torque_limit() const noexcept { return torque_; }

  /// Gravity [m/s^2] in the base frame. Neither allocates nor throws.
  void set_gravity(const Eigen::Vector3d& gravity) noexcept { model_.set_gravity(gravity); }

  /// Replaces the payload: a rigid body in the *tip* frame (mass [kg], com [m], inertia about com [kg m^2]).
  /// Mass 0 takes it off; a payload of Robot::effects stays. Neither allocates nor throws.
  void set_payload(const LinkInertia& payload) noexcept {
    loaded_ = bare_;
    loaded_.template tail<10>() += transformed(to_standard(payload), tip_);
    model_.set_parameters(loaded_);
  }

  /// Whether inertia, payload and gravity are numbers.
  bool finite() const noexcept { return loaded_.allFinite() && model_.gravity().allFinite(); }

  /// Friction torque [N m], eqs. (24) and (25), with what those effects add that are functions of q and dq.
  /// dq [rad/s], q [rad]: n; tau_f: n, written. Neither allocates nor throws.
  void friction(const Vector& q, const Vector& dq, Vector& tau_f) const noexcept {
    const int n = size();
    for (int i = 0; i < n; ++i) tau_f[i] = viscous_[i] * dq[i] + offset_[i];
    if (linear_)
      for (int i = 0; i < n; ++i) tau_f[i] += coulomb_[i] * smooth_sign(dq[i], scale_[i]);
    if (sigmoid_)
      for (int i = 0; i < n; ++i) tau_f[i] += phi1_[i] * (logistic(phi2_[i] * (dq[i] + phi3_[i])) - rest_[i]);
    if (!effects_) return;
    for (int i = 0; i < n; ++i) tau_f[i] += stiffness_[i] * q[i] + effect_offset_[i];
    for (const DryFrictionTerm& term : dry_) tau_f[term.joint] += term.torque(dq[term.joint]);
    for (const RippleTerm& term : ripple_) tau_f[term.joint] += term.torque(q[term.joint]);
    for (const ShaftTerm& term : shafts_) {
      const double torque = term.friction(dq[term.first] + term.ratio * dq[term.second]);
      tau_f[term.first] += torque;
      tau_f[term.second] += term.ratio * torque;
    }
  }

  /// Model torque M(q) ddq + S dq + g + Ia ddq + tau_f [N m], and what effects add that are functions of ddq
  /// or of the torque itself. q, dq, ddq, tau_f (of friction()): n; tau: n, written. Neither allocates nor
  /// throws.
  void torque(Workspace<N>& ws, const Vector& q, const Vector& dq, const Vector& ddq, const Vector& tau_f,
              Vector& tau) const noexcept {
    inverse_dynamics(model_, ws, q, dq, ddq, tau);
    const int n = size();
    for (int i = 0; i < n; ++i) tau[i] += rotor_[i] * ddq[i];
    if (passing_) {
      for (int i = 0; i < n; ++i) {
        double more = gain_[i] != 0.0 ? gain_[i] * (tau[i] + law(i, dq[i])) : 0.0;
        for (const LoadFrictionTerm& term : load_)
          if (term.joint == i) more += term.part(dq[i], tau[i]) * tau[i];
        tau[i] += more;
      }
      for (const ShaftTerm& term : shafts_) {
        const double torque = term.inertia * (ddq[term.first] + term.ratio * ddq[term.second]);
        tau[term.first] += torque;
        tau[term.second] += term.ratio * torque;
      }
    }
    for (int i = 0; i < n; ++i) tau[i] += tau_f[i];
  }

  /// Momentum p = (M + Ia) dq and the known torque u = tau + S^T dq - g - tau_f, so that dp/dt = u + tau_ext.
  /// tau: measured joint torque [N m], from which the effects that change it as it passes are taken off. n
  /// each; p and u are written. Neither allocates nor throws.
  void momentum(Workspace<N>& ws, const Vector& q, const Vector& dq, const Vector& tau, const Vector& tau_f,
                Vector& p, Vector& u) const noexcept {
    dynid::momentum(model_, ws, q, dq, p, u);
    const int n = size();
    for (int i = 0; i < n; ++i) p[i] += rotor_[i] * dq[i];
    if (!passing_) {
      for (int i = 0; i < n; ++i) u[i] += tau[i] - tau_f[i];
      return;
    }
    // tau holds (1 + G + load's part) of the rigid body's torque, tau_f, and G of the friction laws.
    for (int i = 0; i < n; ++i) {
      double left = tau[i] - tau_f[i], share = 1.0 + gain_[i];
      if (gain_[i] != 0.0) left -= gain_[i] * law(i, dq[i]);
      for (const LoadFrictionTerm& term : load_)
        if (term.joint == i) share += term.part(dq[i], left);
      u[i] += left / share;
    }
    for (const ShaftTerm& term : shafts_) {
      const double shaft = term.inertia * (dq[term.first] + term.ratio * dq[term.second]);
      p[term.first] += shaft / (1.0 + gain_[term.first]);
      p[term.second] += term.ratio * shaft / (1.0 + gain_[term.second]);
    }
  }

 private:
  static constexpr int most_terms = N == Eigen::Dynamic ? Eigen::Dynamic : 4 * N;  // of each kind

  explicit TorqueModel(const detail::LoopRobot& loop)
      : model_(loop.robot),
        tip_(loop.robot.tip),
        bare_(10 * model_.size()),
        loaded_(10 * model_.size()),
        stiffness_(loop.terms.stiffness),
        effect_offset_(loop.terms.offset),
        gain_(loop.terms.gain),
        dry_(loop.terms.dry),
        ripple_(loop.terms.ripple),
        load_(loop.terms.load),
        shafts_(loop.terms.shafts) {
    const int n = model_.size();
    for (Vector* v : {&rotor_, &viscous_, &offset_, &coulomb_, &scale_, &phi1_, &phi2_, &phi3_, &rest_,
                      &lower_, &upper_, &velocity_, &torque_})
      *v = Vector::Zero(n);
    for (int i = 0; i < n; ++i) {
      const Joint& joint = loop.robot.joints[i];
      const LinearFriction& f = joint.friction.linear;
      const SigmoidFriction& g = joint.friction.sigmoid;
      rotor_[i] = joint.rotor_inertia;
      viscous_[i] = f.viscous, coulomb_[i] = f.coulomb, offset_[i] = f.offset, scale_[i] = f.velocity_scale;
      phi1_[i] = g.phi1, phi2_[i] = g.phi2, phi3_[i] = g.phi3;
      rest_[i] = logistic(g.phi2 * g.phi3);
      lower_[i] = joint.limits.lower, upper_[i] = joint.limits.upper;
      velocity_[i] = joint.limits.velocity, torque_[i] = joint.limits.torque;
      for (double x : {rotor_[i], f.viscous, f.coulomb, f.offset, f.velocity_scale, g.phi1, g.phi2, g.phi3})
        if (!std::isfinite(x))
          throw Error("joint '" + joint.name + "': rotor inertia or friction not finite");
      if (std::isnan(lower_[i]) || std::isnan(upper_[i]) || std::isnan(velocity_[i]) ||
          std::isnan(torque_[i]))
        throw Error("joint '" + joint.name + "': a limit is not a number");
      bare_.template segment<10>(10 * i) = joint.parameters;
    }
    loaded_ = bare_;
    model_.set_parameters(loaded_);
    linear_ = (coulomb_.array() != 0.0).any();
    sigmoid_ = (phi1_.array() != 0.0).any();
    passing_ = (gain_.array() != 0.0).any() || !load_.empty() || !shafts_.empty();
    effects_ = (stiffness_.array() != 0.0).any() || (effect_offset_.array() != 0.0).any() || !dry_.empty() ||
               !ripple_.empty() || !shafts_.empty();
  }

  /// Friction of eqs. (24) and (25) of joint i alone.
  double law(int i, double dq) const noexcept {
    return viscous_[i] * dq + offset_[i] + coulomb_[i] * smooth_sign(dq, scale_[i]) +
           phi1_[i] * (logistic(phi2_[i] * (dq + phi3_[i])) - rest_[i]);
  }

  Model<N> model_;
  Eigen::Isometry3d tip_;
  Eigen::Matrix<double, N == Eigen::Dynamic ? Eigen::Dynamic : 10 * N, 1> bare_, loaded_;
  Vector rotor_, viscous_, offset_, coulomb_, scale_, phi1_, phi2_, phi3_, rest_;
  Vector lower_, upper_, velocity_, torque_;
  Vector stiffness_, effect_offset_, gain_;
  detail::TermList<DryFrictionTerm, most_terms> dry_;
  detail::TermList<RippleTerm, most_terms> ripple_;
  detail::TermList<LoadFrictionTerm, most_terms> load_;
  detail::TermList<ShaftTerm, most_terms> shafts_;
  bool linear_ = false, sigmoid_ = false;
  bool effects_ = false;  ///< some add to friction()
  bool passing_ = false;  ///< some depend on ddq or on the torque that passes through
};

}  // namespace dynid
