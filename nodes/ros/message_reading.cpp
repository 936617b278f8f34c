// SPDX-License-Identifier: Apache-2.0
#include "ros/message_reading.hpp"

#include "dynid/base/error.hpp"

namespace dynid {

MessageReading::MessageReading(const Assumptions& a, const Robot& robot)
    : without_gravity_(a.without_gravity) {
  if (a.time_unit != 1.0) throw Error("time_unit: the stamps of messages are in seconds");
  if (!a.order.empty())
    throw Error("joint_order: joints are found by name: give ~joint_names in the order of the model");
  if (a.velocity_from_position)
    throw Error("velocity_unit: from_position needs more than one sample: publish the velocity");
  if (a.magnitude)
    throw Error("torque_is_magnitude: a sign taken from the model would hide what the environment does");
  Assumptions of_sample = a;
  of_sample.gravity.reset();
  if (of_sample.empty()) return;
  const int n = robot.size();
  const auto or_ones = [n](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return x.size() == n ? x : Eigen::VectorXd::Ones(n);
  };
  const Eigen::VectorXd sign = or_ones(a.joint_sign);
  position_factor_ = sign;
  for (int j = 0; j < n; ++j)
    if (robot.joints[static_cast<std::size_t>(j)].type != JointType::prismatic)
      position_factor_[j] *= a.position_unit;
  zero_ = a.zero.size() == n ? a.zero : Eigen::VectorXd::Zero(n);
  velocity_factor_ = a.velocity_unit * sign;
  torque_factor_ = sign.cwiseProduct(or_ones(a.torque_factor)).cwiseProduct(or_ones(a.torque_sign));
}

void MessageReading::apply(Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& tau) const noexcept {
  if (!changes()) return;
  q = q.cwiseProduct(position_factor_) + zero_;
  dq = dq.cwiseProduct(velocity_factor_);
  tau = tau.cwiseProduct(torque_factor_);
}

Assumptions parse_stream_assumptions(const std::string& text, int joints) {
  if (text == "auto")
    throw Error(
        "auto: a single sample does not tell how it is to be read: give what /diagnostics (reading), "
        "`dynid diagnose` or identification_node says");
  try {
    return parse_assumptions(text, joints);
  } catch (const Error& error) {
    const std::string said = error.what(), option = "--assume: ";
    throw Error(said.rfind(option, 0) == 0 ? said.substr(option.size()) : said);
  }
}

}  // namespace dynid
