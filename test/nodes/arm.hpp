// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/JointState.h>

#include <cmath>
#include <string>

#include "dynid/estimation/torque_model.hpp"
#include "dynid/model/robot_file.hpp"

namespace dynid::test {

/// A Panda that moves as it is told and has exactly the torques of its model.
class Arm {
 public:
  explicit Arm(const Robot& robot) : model_(robot), ws_(model_.rigid_body()) {
    for (const Joint& joint : robot.joints) message_.name.push_back(joint.name);
    const std::size_t n = message_.name.size();
    message_.position.resize(n);
    message_.velocity.resize(n);
    message_.effort.resize(n);
    external = Eigen::VectorXd::Zero(robot.size());
    q_ = dq_ = ddq_ = tau_f_ = tau_ = external;
  }

  TorqueModel<>& model() { return model_; }
  const Eigen::VectorXd& q() const { return q_; }
  const Eigen::VectorXd& tau() const { return tau_; }  ///< measured: model torque less the external one
  Eigen::VectorXd external;                            ///< [N m] from the environment
  double amplitude = 0.3;                              ///< [rad]; 0 rests but for the encoders' last digit

  /// At t [s] of the motion.
  sensor_msgs::JointState& at(double t) {
    static constexpr double middle[] = {0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785};
    for (Eigen::Index i = 0; i < q_.size(); ++i) {
      const double w = 1.0 + 0.2 * static_cast<double>(i), phase = w * t + static_cast<double>(i);
      q_[i] = middle[i % 7] + amplitude * std::sin(phase) + 1e-7 * std::sin(997.0 * t + 1.0);
      dq_[i] = amplitude * w * std::cos(phase);
      ddq_[i] = -amplitude * w * w * std::sin(phase);
    }
    model_.friction(q_, dq_, tau_f_);
    model_.torque(ws_, q_, dq_, ddq_, tau_f_, tau_);
    tau_ -= external;
    for (std::size_t i = 0; i < message_.name.size(); ++i) {
      message_.position[i] = q_[static_cast<Eigen::Index>(i)];
      message_.velocity[i] = dq_[static_cast<Eigen::Index>(i)];
      message_.effort[i] = tau_[static_cast<Eigen::Index>(i)];
    }
    return message_;
  }

 private:
  TorqueModel<> model_;
  Workspace<> ws_;
  sensor_msgs::JointState message_;
  Eigen::VectorXd q_, dq_, ddq_, tau_f_, tau_;
};

}  // namespace dynid::test
