// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <geometry_msgs/AccelWithCovarianceStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <visualization_msgs/Marker.h>

#include <string>
#include <vector>

#include "ros/estimator_core.hpp"

namespace dynid {

/// What torque_estimator_node publishes for each message that it answers, with the message's own stamp. The
/// messages are made once; roscpp serialises them only where someone listens.
class EstimatorOutputs {
 public:
  /// links: names, base to tip; base: frame of the arm's base in tf, for the marker; queue: of each topic; a
  /// subscriber that falls further behind loses the oldest.
  EstimatorOutputs(ros::NodeHandle& handle, const std::vector<std::string>& joints,
                   const std::vector<std::string>& links, const std::string& base,
                   const std::string& wrench_frame, int queue);

  /// For an answer that is not withheld.
  void publish(const EstimatorAnswer& answer, const ros::Time& stamp);

 private:
  struct Torques {
    ros::Publisher publisher;
    sensor_msgs::JointState message;
  };
  template <class Values>
  static void publish(Torques& torques, const Values& values, const ros::Time& stamp);

  void publish_push(const EstimatorAnswer& answer, const ros::Time& stamp);
  void publish_marker(const Contact<>& push, const ros::Time& stamp);

  Torques tau_model_, tau_friction_, tau_ext_, residual_, contact_joints_, contact_residual_;
  ros::Publisher wrench_publisher_, contact_publisher_, push_publisher_, link_publisher_, marker_publisher_;
  std::vector<std::string> links_;
  geometry_msgs::AccelWithCovarianceStamped push_;
  std_msgs::String link_;
  visualization_msgs::Marker arrow_, label_;
  bool marked_ = false;  // the markers are shown
  geometry_msgs::WrenchStamped wrench_;
  std_msgs::Bool contact_;
};

}  // namespace dynid
