// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// Gains of the controller, the same for every joint: w is `bandwidth` over the control period dt, and the
/// feedback on the acceleration is w^2 (q_d - q) + 2 `damping` w (dq_d - dq) + `integral` w^3 integral(q_d -
/// q).
struct ControlGains {
  double bandwidth = 0.02;  ///< w dt, [rad]: 20 rad/s at 1 kHz
  double damping = 1.0;     ///< ratio; 1: critical
  double integral = 0.125;  ///< stable below 2 `damping`
  /// The feedback acts on the model's inertia and, on the diagonal, on a drive's beside it: this part of the
  /// largest inertia among the joints of the same type, at most `most_drive` times what the joint moves
  /// alone, 1 / (M^-1)_jj, and for no motion of the arm more than `most_drive` times its inertia. A light
  /// joint stays stiff when it carries more than the model says, and a lighter one stays stable.
  double drive = 0.025;
  double most_drive = 10.0;
};

/// Computed-torque control (inverse dynamics with feedback on the acceleration) with a nominal model:
/// tau = M (ddq_d + feedback) + S dq + g + friction of eqs. (24), (25) at dq_d, with the feedback of
/// ControlGains. The model's effects are not compensated.
class ComputedTorque {
 public:
  /// Throws Error where Model does.
  explicit ComputedTorque(const Robot& nominal, const ControlGains& gains = {});

  /// Torque command [N m] for the desired motion (q_d, dq_d, ddq_d) at the measured one (q, dq), `dt` [s]
  /// after the last call; n each. Neither allocates nor throws.
  void operator()(const Eigen::VectorXd& q_d, const Eigen::VectorXd& dq_d, const Eigen::VectorXd& ddq_d,
                  const Eigen::VectorXd& q, const Eigen::VectorXd& dq, double dt,
                  Eigen::VectorXd& tau) noexcept;
  /// Forgets the integral.
  void reset() noexcept { integral_.setZero(); }

 private:
  Model<> model_;
  Workspace<> ws_;
  ControlGains gains_;
  Eigen::VectorXd rotor_, drive_, integral_, feedback_, reference_;
  std::vector<JointFriction> friction_;
};

}  // namespace dynid
