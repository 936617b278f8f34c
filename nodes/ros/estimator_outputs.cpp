// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_outputs.hpp"

namespace dynid {

EstimatorOutputs::EstimatorOutputs(ros::NodeHandle& handle, const std::vector<std::string>& joints,
                                   const std::string& wrench_frame, int queue) {
  const auto advertise = [&](Torques& torques, const char* topic) {
    torques.publisher = handle.advertise<sensor_msgs::JointState>(topic, static_cast<std::uint32_t>(queue));
    torques.message.name = joints;
    torques.message.effort.assign(joints.size(), 0.0);
  };
  advertise(tau_model_, "tau_model");
  advertise(tau_friction_, "tau_friction");
  advertise(tau_ext_, "tau_ext");
  advertise(residual_, "residual");
  advertise(contact_joints_, "contact_joints");
  wrench_publisher_ =
      handle.advertise<geometry_msgs::WrenchStamped>("external_wrench", static_cast<std::uint32_t>(queue));
  contact_publisher_ = handle.advertise<std_msgs::Bool>("contact", static_cast<std::uint32_t>(queue));
  wrench_.header.frame_id = wrench_frame;
}

template <class Values>
void EstimatorOutputs::publish(Torques& torques, const Values& values, const ros::Time& stamp) {
  torques.message.header.stamp = stamp;
  for (Eigen::Index i = 0; i < values.size(); ++i)
    torques.message.effort[static_cast<std::size_t>(i)] = values[i];
  torques.publisher.publish(torques.message);
}

void EstimatorOutputs::publish(const EstimatorAnswer& answer, const ros::Time& stamp) {
  const Estimate<>& estimate = *answer.estimate;
  publish(residual_, estimate.residual, stamp);
  contact_.data = static_cast<std::uint8_t>(estimate.contact.any());
  contact_publisher_.publish(contact_);
  publish(tau_ext_, estimate.tau_external, stamp);
  publish(tau_model_, estimate.tau_model, stamp);
  publish(tau_friction_, estimate.tau_friction, stamp);
  publish(contact_joints_, estimate.contact, stamp);
  if (!answer.has_wrench) return;
  wrench_.header.stamp = stamp;
  wrench_.wrench.force.x = answer.wrench[0];
  wrench_.wrench.force.y = answer.wrench[1];
  wrench_.wrench.force.z = answer.wrench[2];
  wrench_.wrench.torque.x = answer.wrench[3];
  wrench_.wrench.torque.y = answer.wrench[4];
  wrench_.wrench.torque.z = answer.wrench[5];
  wrench_publisher_.publish(wrench_);
}

}  // namespace dynid
