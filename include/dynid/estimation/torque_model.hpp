// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/estimation/momentum.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid {

/// All that a model says of the joint torque, compiled for the loop: rigid body, rotor inertia, friction of
/// eqs. (24) and (25), a payload, and of Robot::effects those that are functions of q and dq alone:
///   joint_spring, torque_offset, viscous_friction, coulomb_friction, asymmetric_coulomb_friction,
///   stribeck_friction, rotor_inertia, payload.
/// The others are not compensated; uncompensated_effects() names them.
///
/// For a fixed N a copy is a plain copy, without allocation. The constructor throws Error.
template <int N = Eigen::Dynamic>
class TorqueModel {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// Throws Error where Model does, on friction or limits that are not numbers, and on an effect without a
  /// parameter that it needs (`effect 'joint_spring': stiffness: 7 values needed`).
  explicit TorqueModel(const Robot& robot)
      : model_(robot), tip_(robot.tip), bare_(10 * model_.size()), loaded_(10 * model_.size()) {
    const int n = model_.size();
    for (Vector* v : {&rotor_, &viscous_, &offset_, &coulomb_, &scale_, &phi1_, &phi2_, &phi3_, &rest_,
                      &stiffness_, &lower_, &upper_, &velocity_, &torque_})
      *v = Vector::Zero(n);
    for (int i = 0; i < n; ++i) {
      const Joint& joint = robot.joints[i];
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
    for (const Effect& effect : robot.effects) add(effect);
    loaded_ = bare_;
    model_.set_parameters(loaded_);
    linear_ = (coulomb_.array() != 0.0).any();
    sigmoid_ = (phi1_.array() != 0.0).any();
    spring_ = (stiffness_.array() != 0.0).any();
  }

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

  /// Friction torque [N m], eqs. (24) and (25), with what the compensated effects add. dq [rad/s], q [rad]:
  /// n; tau_f: n, written. Neither allocates nor throws.
  void friction(const Vector& q, const Vector& dq, Vector& tau_f) const noexcept {
    const int n = size();
    for (int i = 0; i < n; ++i) tau_f[i] = viscous_[i] * dq[i] + offset_[i];
    if (linear_)
      for (int i = 0; i < n; ++i) tau_f[i] += coulomb_[i] * smooth_sign(dq[i], scale_[i]);
    if (sigmoid_)
      for (int i = 0; i < n; ++i) tau_f[i] += phi1_[i] * (logistic(phi2_[i] * (dq[i] + phi3_[i])) - rest_[i]);
    if (spring_)
      for (int i = 0; i < n; ++i) tau_f[i] += stiffness_[i] * q[i];
    for (int k = 0; k < dry_count_; ++k) {
      const Dry& d = dry_[k];
      for (int i = 0; i < n; ++i) {
        const double fall = std::exp(-std::pow(std::abs(dq[i] * d.slowness[i]), d.exponent[i]));
        tau_f[i] += (dq[i] > 0.0 ? d.forward[i] : d.back[i]) * fall * smooth_sign(dq[i], d.scale);
      }
    }
  }

  /// Model torque M(q) ddq + S dq + g + Ia ddq + tau_f [N m]. q, dq, ddq, tau_f (of friction()): n; tau: n,
  /// written. Neither allocates nor throws.
  void torque(Workspace<N>& ws, const Vector& q, const Vector& dq, const Vector& ddq, const Vector& tau_f,
              Vector& tau) const noexcept {
    inverse_dynamics(model_, ws, q, dq, ddq, tau);
    for (int i = 0; i < size(); ++i) tau[i] += rotor_[i] * ddq[i] + tau_f[i];
  }

  /// Momentum p = (M + Ia) dq and the known torque u = tau + S^T dq - g - tau_f, so that dp/dt = u + tau_ext.
  /// tau: measured joint torque [N m]. n each; p and u are written. Neither allocates nor throws.
  void momentum(Workspace<N>& ws, const Vector& q, const Vector& dq, const Vector& tau, const Vector& tau_f,
                Vector& p, Vector& u) const noexcept {
    dynid::momentum(model_, ws, q, dq, p, u);
    for (int i = 0; i < size(); ++i) {
      p[i] += rotor_[i] * dq[i];
      u[i] += tau[i] - tau_f[i];
    }
  }

  /// Whether add() takes an effect of that name.
  static bool compensates(const std::string& name) {
    for (const char* known : {"joint_spring", "torque_offset", "viscous_friction", "coulomb_friction",
                              "asymmetric_coulomb_friction", "stribeck_friction", "rotor_inertia", "payload"})
      if (name == known) return true;
    return false;
  }

 private:
  /// (forward or back) exp(-|slowness dq|^exponent) tanh(dq / scale)
  struct Dry {
    Vector forward, back, slowness, exponent;
    double scale;
  };
  static constexpr int most_dry = 3;

  static const std::vector<double>& values(const Effect& effect, const char* key, int count) {
    const auto at = effect.parameters.find(key);
    if (at == effect.parameters.end() || static_cast<int>(at->second.size()) != count)
      throw Error("effect '" + effect.name + "': " + key + ": " + std::to_string(count) + " values needed");
    for (double x : at->second)
      if (!std::isfinite(x)) throw Error("effect '" + effect.name + "': " + key + ": not finite");
    return at->second;
  }
  Vector over_joints(const Effect& effect, const char* key) const {
    return Eigen::Map<const Eigen::VectorXd>(values(effect, key, size()).data(), size());
  }

  // Signs and symbols as in simulation_effects().
  void add(const Effect& effect) {
    const std::string& name = effect.name;
    if (name == "joint_spring") {
      // Two springs on a joint are one: k (q - q0), k the sum, k q0 the sum of k q0.
      const Vector k = over_joints(effect, "stiffness");
      const Vector pull = k.cwiseProduct(over_joints(effect, "rest"));
      stiffness_ += k;
      offset_ -= pull;
    } else if (name == "torque_offset") {
      offset_ += over_joints(effect, "offset");
    } else if (name == "viscous_friction") {
      viscous_ += over_joints(effect, "coefficient");
    } else if (name == "rotor_inertia") {
      rotor_ += over_joints(effect, "armature");
    } else if (name == "payload") {
      LinkInertia ball;
      ball.mass = values(effect, "mass", 1)[0];
      ball.com = Eigen::Map<const Eigen::Vector3d>(values(effect, "com", 3).data());
      const double radius = values(effect, "radius", 1)[0];
      ball.inertia = 0.4 * ball.mass * radius * radius * Eigen::Matrix3d::Identity();
      bare_.template tail<10>() += transformed(to_standard(ball), tip_);
    } else if (compensates(name)) {
      if (dry_count_ == most_dry) throw Error("effect '" + name + "': more than three kinds of dry friction");
      Dry& d = dry_[dry_count_++];
      d.scale = values(effect, "velocity_scale", 1)[0];
      d.slowness = Vector::Zero(size());
      d.exponent = Vector::Constant(size(), 2.0);
      if (name == "asymmetric_coulomb_friction") {
        d.forward = over_joints(effect, "coefficient_positive");
        d.back = over_joints(effect, "coefficient_negative");
      } else if (name == "coulomb_friction") {
        d.forward = d.back = over_joints(effect, "coefficient");
      } else {
        d.forward = d.back = over_joints(effect, "static");
        const Vector v = over_joints(effect, "stribeck_velocity");
        for (int i = 0; i < size(); ++i) d.slowness[i] = v[i] > 0.0 ? 1.0 / v[i] : 0.0;
        if (effect.parameters.count("exponent") > 0) d.exponent = over_joints(effect, "exponent");
      }
    }
  }

  Model<N> model_;
  Eigen::Isometry3d tip_;
  Eigen::Matrix<double, N == Eigen::Dynamic ? Eigen::Dynamic : 10 * N, 1> bare_, loaded_;
  Vector rotor_, viscous_, offset_, coulomb_, scale_, phi1_, phi2_, phi3_, rest_, stiffness_;
  Vector lower_, upper_, velocity_, torque_;
  std::array<Dry, most_dry> dry_;
  int dry_count_ = 0;
  bool linear_ = false, sigmoid_ = false, spring_ = false;
};

/// Effects of the robot that a TorqueModel leaves out, each once, in their order: for the log at set-up.
inline std::vector<std::string> uncompensated_effects(const Robot& robot) {
  std::vector<std::string> names;
  for (const Effect& effect : robot.effects) {
    bool known = TorqueModel<>::compensates(effect.name);
    for (const std::string& name : names) known = known || name == effect.name;
    if (!known) names.push_back(effect.name);
  }
  return names;
}

}  // namespace dynid
