// SPDX-License-Identifier: Apache-2.0
#include "ros/command_recording.hpp"

#include "dynid/base/text.hpp"
#include "ros/command_rows.hpp"

namespace dynid {

void CommandRecording::add(const AnyMessage& message, const ros::Time& arrival) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!running_) return;
  const auto& types = CommandRows::types();
  const auto type = types.find(message.type);
  if (type == types.end() || type->second != message.md5sum) {
    std::vector<std::string> names;
    for (const auto& [name, sum] : types) names.push_back(name);
    ++dropped_;
    if (first_drop_.empty()) first_drop_ = "it is " + message.type + ", not " + join(names, " or ");
    return;
  }
  messages_.push_back(message);
  messages_.back().arrival = arrival;
}

void CommandRecording::start() {
  const std::lock_guard<std::mutex> lock(mutex_);
  messages_.clear();
  dropped_ = 0;
  first_drop_.clear();
  running_ = true;
}

void CommandRecording::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  running_ = false;
}

CommandRecording::Summary CommandRecording::summary() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return {messages_.size(), dropped_, first_drop_};
}

std::vector<AnyMessage> CommandRecording::messages() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return messages_;
}

}  // namespace dynid
