// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/model/robot.hpp"

namespace dynid {

/// Gains of the controller, the same for every joint.
struct ControlGains {
  double stiffness = 400.0;     ///< Kp [1/s^2], on the model's inertia
  double damping = 40.0;        ///< Kd [1/s]
  double integral = 1000.0;     ///< Ki [1/s^3]
  double drive_inertia = 0.05;  ///< [kg m^2] added to the diagonal of the model's inertia in the feedback
                                ///< only: a light joint stays stiff when it carries more than the model says
};

/// Computed-torque control (inverse dynamics with feedback on the acceleration) with a nominal model:
/// tau = M (ddq_d + Kd (dq_d - dq) + Kp (q_d - q) + Ki integral(q_d - q)) + S dq + g + friction of eqs. (24),
/// (25) at dq_d. The model's effects are not compensated.
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
  Eigen::VectorXd rotor_, integral_, feedback_, reference_;
  std::vector<JointFriction> friction_;
};

}  // namespace dynid
