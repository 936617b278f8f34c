// SPDX-License-Identifier: Apache-2.0
#include "ros/recording.hpp"

#include "dynid/base/error.hpp"

namespace dynid {

void JointRecording::add(const sensor_msgs::JointState& message, const ros::Time& arrival) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    if (!reader_.read(message)) return;
    if (pose_.known && message.header.stamp < pose_.stamp) {
      // A publisher that started anew may keep another time: the pose follows it, a recording cannot.
      if (!running_ || messages_.empty()) pose_.known = false;
      if (running_ && !messages_.empty()) throw Error("its stamp goes back");
    }
    if (running_ && !messages_.empty()) {
      const sensor_msgs::JointState& first = messages_.front();
      if (first.velocity.empty() != message.velocity.empty() ||
          first.effort.empty() != message.effort.empty())
        throw Error("velocity or effort is not in every message");
    }
  } catch (const Error& error) {
    if (!running_) return;
    ++dropped_;
    if (first_drop_.empty()) first_drop_ = error.what();
    return;
  }
  pose_.known = true;
  pose_.stamp = message.header.stamp;
  pose_.q = reader_.q();
  pose_.dq = reader_.dq();
  arrival_ = Clock::now();
  if (!running_) return;
  messages_.push_back(message);
  arrivals_.push_back(arrival);
}

void JointRecording::start() {
  const std::lock_guard<std::mutex> lock(mutex_);
  messages_.clear();
  arrivals_.clear();
  dropped_ = 0;
  first_drop_.clear();
  arrival_ = Clock::now();
  running_ = true;
}

void JointRecording::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  running_ = false;
}

JointRecording::Pose JointRecording::pose() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  Pose pose = pose_;
  pose.age = std::chrono::duration<double>(Clock::now() - arrival_).count();
  return pose;
}

JointRecording::Summary JointRecording::summary() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  Summary summary;
  summary.running = running_;
  summary.messages = messages_.size();
  summary.dropped = dropped_;
  summary.first_drop = first_drop_;
  if (!messages_.empty())
    summary.duration = messages_.back().header.stamp.isZero()
                           ? (arrivals_.back() - arrivals_.front()).toSec()
                           : (messages_.back().header.stamp - messages_.front().header.stamp).toSec();
  return summary;
}

std::vector<sensor_msgs::JointState> JointRecording::messages() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return messages_;
}

std::vector<ros::Time> JointRecording::arrivals() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return arrivals_;
}

}  // namespace dynid
