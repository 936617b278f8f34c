// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_outputs.hpp"

namespace dynid {

namespace {

constexpr double metres_per_newton = 0.02;  // of the arrow

}  // namespace

EstimatorOutputs::EstimatorOutputs(ros::NodeHandle& handle, const std::vector<std::string>& joints,
                                   const std::vector<std::string>& links, const std::string& base,
                                   const std::string& wrench_frame, int queue)
    : links_(links) {
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
  advertise(contact_residual_, "contact_residual");
  wrench_publisher_ =
      handle.advertise<geometry_msgs::WrenchStamped>("external_wrench", static_cast<std::uint32_t>(queue));
  contact_publisher_ = handle.advertise<std_msgs::Bool>("contact", static_cast<std::uint32_t>(queue));
  wrench_.header.frame_id = wrench_frame;
  push_publisher_ = handle.advertise<geometry_msgs::AccelWithCovarianceStamped>(
      "external_wrench_covariance", static_cast<std::uint32_t>(queue));
  link_publisher_ = handle.advertise<std_msgs::String>("contact_link", static_cast<std::uint32_t>(queue));
  marker_publisher_ =
      handle.advertise<visualization_msgs::Marker>("contact_marker", static_cast<std::uint32_t>(queue));
  push_.header.frame_id = wrench_frame;
  for (visualization_msgs::Marker* marker : {&arrow_, &label_}) {
    marker->header.frame_id = base;
    marker->ns = "contact";
    marker->pose.orientation.w = 1.0;
    marker->color.r = 1.0F, marker->color.g = 0.3F, marker->color.a = 1.0F;
  }
  arrow_.type = visualization_msgs::Marker::ARROW;
  arrow_.points.resize(2);
  arrow_.scale.x = 0.02, arrow_.scale.y = 0.04;
  label_.id = 1;
  label_.type = visualization_msgs::Marker::TEXT_VIEW_FACING;
  label_.scale.z = 0.05;
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
  contact_.data =
      static_cast<std::uint8_t>(estimate.tested ? estimate.pushed.detected : estimate.contact.any());
  contact_publisher_.publish(contact_);
  publish(tau_ext_, estimate.tau_external, stamp);
  publish(tau_model_, estimate.tau_model, stamp);
  publish(tau_friction_, estimate.tau_friction, stamp);
  publish(contact_joints_, estimate.contact, stamp);
  if (estimate.tested) publish_push(answer, stamp);
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

void EstimatorOutputs::publish_push(const EstimatorAnswer& answer, const ros::Time& stamp) {
  const Contact<>& push = answer.estimate->pushed;
  publish(contact_residual_, push.residual, stamp);
  publish_marker(push, stamp);
  link_.data = push.link < 0 ? "" : links_[static_cast<std::size_t>(push.link)];
  link_publisher_.publish(link_);
  if (!answer.has_push) return;
  push_.header.stamp = stamp;
  geometry_msgs::Vector3 &force = push_.accel.accel.linear, &moment = push_.accel.accel.angular;
  force.x = answer.push[0], force.y = answer.push[1], force.z = answer.push[2];
  moment.x = answer.push[3], moment.y = answer.push[4], moment.z = answer.push[5];
  for (Eigen::Index r = 0; r < 6; ++r)
    for (Eigen::Index c = 0; c < 6; ++c)
      push_.accel.covariance[static_cast<std::size_t>(6 * r + c)] = answer.push_covariance(r, c);
  push_publisher_.publish(push_);
}

// The arrow ends where the push acts.
void EstimatorOutputs::publish_marker(const Contact<>& push, const ros::Time& stamp) {
  if (!push.detected && !marked_) return;
  marked_ = push.detected;
  const Eigen::Vector3d tail = push.point - metres_per_newton * push.wrench.head<3>();
  for (visualization_msgs::Marker* marker : {&arrow_, &label_}) {
    marker->header.stamp = stamp;
    marker->action = push.detected ? visualization_msgs::Marker::ADD : visualization_msgs::Marker::DELETE;
  }
  arrow_.points[0].x = tail.x(), arrow_.points[0].y = tail.y(), arrow_.points[0].z = tail.z();
  arrow_.points[1].x = push.point.x(), arrow_.points[1].y = push.point.y(),
  arrow_.points[1].z = push.point.z();
  label_.pose.position = arrow_.points[0];
  if (push.link >= 0) label_.text = links_[static_cast<std::size_t>(push.link)];
  marker_publisher_.publish(arrow_);
  marker_publisher_.publish(label_);
}

}  // namespace dynid
