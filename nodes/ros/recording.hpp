// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/JointState.h>

#include <Eigen/Core>
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "ros/joint_state.hpp"

namespace dynid {

/// The joint states that arrive, kept while a recording runs. One thread adds, any other may ask.
class JointRecording {
 public:
  explicit JointRecording(std::vector<std::string> joints) : reader_(std::move(joints)) {}

  /// A message as it arrives, at `arrival`. Messages with none of the robot's joints are passed over; those
  /// that JointStateReader refuses, or whose stamp goes back, are dropped and counted. Does not throw.
  void add(const sensor_msgs::JointState& message, const ros::Time& arrival);

  void start();  ///< forgets what was recorded before
  void stop();

  /// The robot as it was last seen.
  struct Pose {
    bool known = false;
    double age = 0.0;  ///< [s] since it arrived, or since there has been none
    ros::Time stamp;
    Eigen::VectorXd q, dq;  ///< n [rad, rad/s]; dq empty where it is not sent
  };
  Pose pose() const;

  struct Summary {
    bool running = false;
    std::size_t messages = 0, dropped = 0;
    std::string first_drop;  ///< why
    double duration = 0.0;   ///< [s] by the stamps, where there are none by arrival
  };
  Summary summary() const;

  std::vector<sensor_msgs::JointState> messages() const;  ///< a copy
  std::vector<ros::Time> arrivals() const;                ///< of each

 private:
  using Clock = std::chrono::steady_clock;

  mutable std::mutex mutex_;
  JointStateReader reader_;
  bool running_ = false;
  std::vector<sensor_msgs::JointState> messages_;
  std::vector<ros::Time> arrivals_;
  std::size_t dropped_ = 0;
  std::string first_drop_;
  Pose pose_;
  Clock::time_point arrival_ = Clock::now();
};

}  // namespace dynid
