// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/computed_torque.hpp"

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/friction/friction.hpp"
#include "rigid_body.hpp"

namespace dynid {

ComputedTorque::ComputedTorque(const Robot& nominal, const ControlGains& gains)
    : model_(nominal),
      ws_(model_),
      gains_(gains),
      rotor_(detail::rotor_inertias(nominal)),
      integral_(Eigen::VectorXd::Zero(nominal.size())),
      feedback_(nominal.size()),
      reference_(nominal.size()),
      friction_(detail::smooth_friction(nominal)) {}

void ComputedTorque::operator()(const Eigen::VectorXd& q_d, const Eigen::VectorXd& dq_d,
                                const Eigen::VectorXd& ddq_d, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& dq, double dt, Eigen::VectorXd& tau) noexcept {
  integral_ += dt * (q_d - q);
  feedback_ = gains_.stiffness * (q_d - q) + gains_.damping * (dq_d - dq) + gains_.integral * integral_;
  reference_ = ddq_d + feedback_;
  inverse_dynamics(model_, ws_, q, dq, reference_, tau);
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    tau[j] += rotor_[j] * reference_[j] + gains_.drive_inertia * feedback_[j] +
              friction_torque(friction_[static_cast<std::size_t>(j)], dq_d[j]);
}

}  // namespace dynid
