// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "time_scale.hpp"

namespace dynid::test {

/// What a torque_estimator_node says: the last message of each topic, and how many there were.
class EstimatorClient {
 public:
  struct Diagnostic {
    int level = -1;
    std::string message;
    std::map<std::string, std::string> values;
    int reports = 0;
    long count(const std::string& key) const {
      const auto at = values.find(key);
      return at == values.end() ? -1 : std::atol(at->second.c_str());
    }
    double number(const std::string& key) const {
      const auto at = values.find(key);
      return at == values.end() ? -1.0 : std::atof(at->second.c_str());
    }
  };
  struct Heard {
    sensor_msgs::JointState tau_model, tau_friction, tau_ext, residual, contact_joints;
    geometry_msgs::WrenchStamped wrench;
    std::string parameters;
    bool contact = false;
    int residuals = 0, wrenches = 0, contacts = 0;
  };

  EstimatorClient(ros::NodeHandle& handle, const std::string& name) : name_(name) {
    const auto listen = [&](const char* topic, sensor_msgs::JointState Heard::*to) {
      subscribers_.push_back(handle.subscribe<sensor_msgs::JointState>(
          name + "/" + topic, 1000, [this, to](const sensor_msgs::JointState::ConstPtr& message) {
            const std::lock_guard<std::mutex> lock(mutex_);
            heard_.*to = *message;
            if (to != &Heard::residual) return;
            ++heard_.residuals;
            ++answers_[message->header.stamp];
          }));
    };
    listen("tau_model", &Heard::tau_model);
    listen("tau_friction", &Heard::tau_friction);
    listen("tau_ext", &Heard::tau_ext);
    listen("residual", &Heard::residual);
    listen("contact_joints", &Heard::contact_joints);
    subscribers_.push_back(handle.subscribe<geometry_msgs::WrenchStamped>(
        name + "/external_wrench", 100, [this](const geometry_msgs::WrenchStamped::ConstPtr& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          heard_.wrench = *message;
          ++heard_.wrenches;
        }));
    subscribers_.push_back(handle.subscribe<std_msgs::Bool>(name + "/contact", 100,
                                                            [this](const std_msgs::Bool::ConstPtr& message) {
                                                              const std::lock_guard<std::mutex> lock(mutex_);
                                                              heard_.contact = message->data != 0;
                                                              ++heard_.contacts;
                                                            }));
    subscribers_.push_back(handle.subscribe<std_msgs::String>(
        name + "/parameters", 1, [this](const std_msgs::String::ConstPtr& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          heard_.parameters = message->data;
        }));
    subscribers_.push_back(handle.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          for (const auto& status : message->status) {
            if (status.name.compare(0, name_.size() + 2, name_ + ": ") != 0) continue;
            std::vector<Diagnostic>& all = diagnostics_[status.name.substr(name_.size() + 2)];
            all.push_back(all.empty() ? Diagnostic() : all.back());
            Diagnostic& kept = all.back();
            kept.level = status.level;
            kept.message = status.message;
            ++kept.reports;
            for (const auto& value : status.values) kept.values[value.key] = value.value;
          }
        }));
  }

  Heard heard() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return heard_;
  }
  /// How many residuals there were with one of these stamps.
  int answers(const std::vector<ros::Time>& stamps) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    int count = 0;
    for (const ros::Time& stamp : std::set<ros::Time>(stamps.begin(), stamps.end())) {
      const auto at = answers_.find(stamp);
      if (at != answers_.end()) count += at->second;
    }
    return count;
  }
  /// `input`, `output`, `model`, `frames` or `reading`.
  Diagnostic diagnostic(const std::string& task) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto at = diagnostics_.find(task);
    return at == diagnostics_.end() ? Diagnostic() : at->second.back();
  }
  /// Whether, of the task's reports beyond the first `after`, there is one of which `wanted` is true: of two
  /// that come at once the first is seen, too.
  bool said(const std::string& task, int after, const std::function<bool(const Diagnostic&)>& wanted) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto at = diagnostics_.find(task);
    return at != diagnostics_.end() && after < static_cast<int>(at->second.size()) &&
           std::any_of(at->second.begin() + after, at->second.end(), wanted);
  }
  /// Waits for a report of which `wanted` is true.
  bool reports(const std::string& task, const std::function<bool(const Diagnostic&)>& wanted,
               double seconds = 5.0) const {
    return wait([&] { return wanted(diagnostic(task)); }, seconds);
  }
  static bool wait(const std::function<bool()>& wanted, double seconds = 5.0) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(time_scale() * seconds);
    while (std::chrono::steady_clock::now() < end) {
      if (wanted()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return wanted();
  }
  std_srvs::Trigger::Response call(const std::string& service) const {
    std_srvs::Trigger trigger;
    if (!ros::service::call("/" + name_ + "/" + service, trigger)) trigger.response.message = "not called";
    return trigger.response;
  }
  const std::string& name() const { return name_; }

 private:
  std::string name_;
  mutable std::mutex mutex_;
  Heard heard_;
  std::map<ros::Time, int> answers_;
  std::map<std::string, std::vector<Diagnostic>> diagnostics_;  // all reports of a task
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace dynid::test
