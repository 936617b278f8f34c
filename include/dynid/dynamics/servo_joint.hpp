// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "dynid/model/robot.hpp"

namespace dynid {

/// Parameters of a servo joint that its open-loop motion depends on, in the order of ServoSensitivity.
enum class ServoParameter {
  inertia,               ///< J / kp [s^2]: rotor inertia, or all of it where no rigid body is known
  damping,               ///< (kd + fv) / kp [s]
  coulomb,               ///< Fc / kp [rad]
  bias,                  ///< [rad]
  delay,                 ///< [s]
  stribeck,              ///< (Fs - Fc) / kp [rad]
  stribeck_velocity,     ///< [rad/s]
  load_friction,         ///< 1
  compliance,            ///< 1 / kp [rad/(N m)]: what the rigid body's torque is multiplied with
  limit,                 ///< torque limit / kp [rad]
  command_lag,           ///< time constant of the command's filter [s]
  spring,                ///< stiffness of a spring at rest at q = 0, over kp; its rest is in the bias
  backlash,              ///< half of the gap between servo and joint [rad]
  gravity_compensation,  ///< part of the gravity torque that the servo adds of itself
};
constexpr int servo_parameters = 14;
/// d/d theta of one quantity, in the order of ServoParameter.
using ServoSensitivity = Eigen::Array<double, servo_parameters, 1>;

/// A servo joint with every torque divided by the stiffness kp:
///   a ddq + c dq + f sgn dq + L = clip(gap(u(t - delay) - q), limit),
///   a = inertia + compliance M_jj,  L = bias + spring q + compliance (h - gravity_compensation g),
///   f = coulomb + stribeck exp(-(dq / stribeck_velocity)^2) + load_friction |T|,
///   T = clip(gap(u - q), limit) + compliance gravity_compensation g - c dq: what the servo gives,
/// gap(e) = 0 inside +-backlash, else e less it.
struct ServoJoint {
  double inertia = 0.0;
  double damping = 0.0;
  double coulomb = 0.0;
  double bias = 0.0;
  double delay = 0.0;
  double stribeck = 0.0;
  double stribeck_velocity = 1.0;
  double load_friction = 0.0;
  double compliance = 0.0;
  double limit = std::numeric_limits<double>::infinity();
  double command_lag = 0.0;
  double spring = 0.0;
  double backlash = 0.0;
  double gravity_compensation = 0.0;

  double& operator[](ServoParameter p) noexcept {
    double* const all[servo_parameters] = {
        &inertia,       &damping,    &coulomb, &bias,        &delay,  &stribeck, &stribeck_velocity,
        &load_friction, &compliance, &limit,   &command_lag, &spring, &backlash, &gravity_compensation};
    return *all[static_cast<int>(p)];
  }
  double operator[](ServoParameter p) const noexcept { return const_cast<ServoJoint&>(*this)[p]; }
};

/// The ratios of a joint that has a servo (`joint.servo` must be set).
inline ServoJoint servo_ratios(const Joint& joint) noexcept {
  const Servo& s = *joint.servo;
  ServoJoint r;
  if (s.kp > 0.0) {
    r.inertia = joint.rotor_inertia / s.kp;
    r.damping = (s.kd + joint.friction.linear.viscous) / s.kp;
    r.coulomb = joint.friction.linear.coulomb / s.kp;
    r.compliance = 1.0 / s.kp;
    r.limit = s.torque_limit / s.kp;
  } else {
    r.inertia = 1.0 / (s.natural_frequency * s.natural_frequency);
    r.damping = 2.0 * s.damping_ratio / s.natural_frequency;
    r.coulomb = s.coulomb_position;
    r.limit = s.error_limit;
  }
  r.bias = s.bias;
  r.delay = s.delay;
  r.stribeck = s.stribeck_position;
  if (s.stribeck_velocity > 0.0) r.stribeck_velocity = s.stribeck_velocity;
  r.load_friction = s.load_friction;
  r.command_lag = s.command_time_constant;
  return r;
}

/// What acts on the joint in one step of length `h` [s].
struct ServoInput {
  double h = 0.0;
  double command = 0.0;       ///< mean over the step of the delayed command [rad]
  double command_rate = 0.0;  ///< minus d command / d delay: its change over the step, over h [rad/s]
  double inertia = 0.0;       ///< M_jj of the rigid body [kg m^2], 0 without one
  double load = 0.0;          ///< torque of the rigid body but M_jj ddq [N m], 0 without one
  double gravity = 0.0;       ///< the part of it that is gravity's [N m]
};

/// What is left of a position error `e` behind a gap of +-`gap`.
inline double behind_gap(double e, double gap) noexcept {
  return std::abs(e) <= gap ? 0.0 : e - std::copysign(gap, e);
}

/// State of one servo joint in open loop, with the sensitivities of the discrete motion.
///
/// One step solves, implicitly in the velocity w of the step,
///   alpha a (w - v) / h + c w + f sgn w + L = clip(u - q - h w / 2),
/// a scalar problem whose solution is a soft threshold: w = S(R, f) / D. Inside |R| <= f the joint sticks:
/// w = 0 exactly, for as long as the command does not exceed the friction. alpha = 2 (the trapezoidal rule,
/// v' = 2 w - v) where the motion keeps its sign and the step resolves a / c; alpha = 1 (v' = w), which
/// neither rings nor creeps, in the steps where it does not.
///
/// The sensitivities are the derivatives of this discrete map, hence exact for it wherever it is smooth:
/// while the joint sticks those of w are zero and those of q hold; at the step of break-away or reversal the
/// branch is held fixed, whose boundary has measure zero and where w is continuous. Neither allocates nor
/// throws. `parts`: of the rigid body's torque, by whose factors the motion is derived too, after
/// ServoParameter's.
template <bool sensitive, int parts = 0>
class ServoState {
 public:
  using Sensitivity = Eigen::Array<double, servo_parameters + parts, 1>;

  explicit ServoState(double q0, double v0, double command) noexcept : q(q0), v(v0), filtered(command) {
    if constexpr (sensitive) dq.setZero(), dv.setZero(), df.setZero();
  }

  /// `part`: `parts` torques [N m] that a factor of one adds to in.load.
  void step(const ServoJoint& p, const ServoInput& in, const double* part = nullptr) noexcept {
    using P = ServoParameter;
    const double h = in.h;
    double u = in.command;
    Sensitivity du;
    if constexpr (sensitive) {
      du.setZero();
      du[int(P::delay)] = -in.command_rate;
    }
    // Of no filter too the derivative is wanted, of one that would be there.
    const double w_lag = h / (p.command_lag + h), slope_lag = u - filtered;
    filtered += w_lag * slope_lag;
    if constexpr (sensitive) {
      df += w_lag * (du - df);
      df[int(P::command_lag)] -= w_lag * w_lag / h * slope_lag;
      du = df;
    }
    u = filtered;
    const double a = p.inertia + p.compliance * in.inertia;
    const double carried = in.load - p.gravity_compensation * in.gravity;
    const double L = p.bias + p.spring * q + p.compliance * carried;
    double e = u - q;
    const bool idle = std::abs(e) <= p.backlash && p.backlash > 0.0;
    const double side = e > 0.0 ? 1.0 : -1.0;
    if (p.backlash > 0.0) e = behind_gap(e, p.backlash);
    const bool saturated = std::abs(e) > p.limit;
    if (saturated) e = std::copysign(p.limit, e);
    const bool held = saturated || idle;  // the torque does not follow the position
    const double kappa = 0.5 * h * ((held ? 0.0 : 1.0) + p.spring);
    double bump = 0.0;
    if (p.stribeck > 0.0) {
      const double x = v / p.stribeck_velocity;
      bump = std::exp(-x * x);
    }
    const double given = e + p.compliance * p.gravity_compensation * in.gravity - p.damping * v;
    const double f = p.coulomb + p.stribeck * bump + p.load_friction * std::abs(given);
    const double r = e - L;

    double alpha = a > 0.5 * p.damping * h ? 2.0 : 1.0;
    double R = alpha * a * v / h + r, D = alpha * a / h + p.damping + kappa;
    double w = threshold(R, f) / D;
    if (alpha == 2.0) {
      const double next = 2.0 * w - v;
      if (w == 0.0 || next * w < 0.0 || next * v < 0.0) {
        alpha = 1.0;
        R = a * v / h + r, D = a / h + p.damping + kappa;
        w = threshold(R, f) / D;
      }
    }
    if constexpr (sensitive) {
      Sensitivity dw;
      if (w == 0.0) {
        dw.setZero();
      } else {
        const double s = w > 0.0 ? 1.0 : -1.0, of_given = s * (given > 0.0 ? 1.0 : -1.0) * p.load_friction;
        const double k = alpha * (v - w) / h;  // of a
        // d(R - s f) - w dD, term by term
        dw = (alpha * a / h) * dv;
        if (!held) {
          dw += (1.0 - of_given) * (du - dq);
          dw[int(P::backlash)] -= (1.0 - of_given) * side;
        }
        if (of_given != 0.0) {
          dw += of_given * p.damping * dv;
          dw[int(P::damping)] += of_given * v;
          dw[int(P::compliance)] -= of_given * p.gravity_compensation * in.gravity;
          dw[int(P::gravity_compensation)] -= of_given * p.compliance * in.gravity;
        }
        if (p.spring != 0.0) dw -= p.spring * dq;
        if (p.stribeck > 0.0) {
          const double x = v / p.stribeck_velocity, slope = 2.0 * x * p.stribeck * bump / p.stribeck_velocity;
          dw += s * slope * dv;
          dw[int(P::stribeck_velocity)] -= s * slope * x;
        }
        dw[int(P::stribeck)] -= s * bump;
        dw[int(P::inertia)] += k;
        dw[int(P::damping)] -= w;
        dw[int(P::coulomb)] -= s;
        dw[int(P::bias)] -= 1.0;
        dw[int(P::spring)] -= q + 0.5 * h * w;
        dw[int(P::compliance)] += k * in.inertia - carried;
        dw[int(P::gravity_compensation)] += p.compliance * in.gravity;
        dw[int(P::load_friction)] -= s * std::abs(given);
        if (saturated) dw[int(P::limit)] += (1.0 - of_given) * (e > 0.0 ? 1.0 : -1.0);
        if constexpr (parts > 0)
          for (int m = 0; m < parts; ++m) dw[servo_parameters + m] -= p.compliance * part[m];
        dw /= D;
      }
      dq += h * dw;
      if (alpha == 2.0)
        dv = 2.0 * dw - dv;
      else
        dv = dw;
    }
    q += h * w;
    v = alpha == 2.0 ? 2.0 * w - v : w;
  }

  double q;                ///< [rad]
  double v;                ///< [rad/s]
  double filtered;         ///< command behind its filter [rad]
  Sensitivity dq, dv, df;  ///< of q, v and filtered; unset where not `sensitive`

 private:
  static double threshold(double R, double f) noexcept { return R > f ? R - f : R < -f ? R + f : 0.0; }
};

/// Commands held from stamp to stamp (zero-order hold) and their integral: the mean over any interval, so
/// that a delay acts smoothly however coarse the stamps are.
class HeldCommand {
 public:
  /// t [s]: N stamps, not decreasing; u [rad]: N commands; both are copied. Before the first stamp the first
  /// command holds.
  HeldCommand(const Eigen::Ref<const Eigen::VectorXd>& t, const Eigen::Ref<const Eigen::VectorXd>& u)
      : t_(t), u_(u), integral_(t.size()) {
    integral_[0] = 0.0;
    for (Eigen::Index i = 1; i < t.size(); ++i)
      integral_[i] = integral_[i - 1] + u[i - 1] * (t[i] - t[i - 1]);
  }

  /// Integral of the command from t_1 to `time`, u at `time` and where it stands; `hint` is the place found
  /// last.
  double integral(double time, Eigen::Index& hint) const noexcept {
    const Eigen::Index n = t_.size();
    while (hint + 1 < n && t_[hint + 1] <= time) ++hint;
    while (hint > 0 && t_[hint] > time) --hint;
    return integral_[hint] + u_[hint] * (time - t_[hint]);
  }
  double at(double time, Eigen::Index& hint) const noexcept {
    integral(time, hint);
    return u_[hint];
  }

  /// Mean command and its change for the step [time, time + h], delayed by `delay`.
  void fill(double time, double h, double delay, Eigen::Index& hint, ServoInput& in) const noexcept {
    const double before = integral(time - delay, hint), u0 = u_[hint];
    const double after = integral(time + h - delay, hint), u1 = u_[hint];
    in.h = h;
    in.command = (after - before) / h;
    in.command_rate = (u1 - u0) / h;
  }

 private:
  Eigen::VectorXd t_, u_, integral_;
};

}  // namespace dynid
