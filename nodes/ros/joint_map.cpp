// SPDX-License-Identifier: Apache-2.0
#include "ros/joint_map.hpp"

#include <algorithm>
#include <utility>

namespace dynid {

JointMap::JointMap(std::vector<std::string> joints)
    : joints_(std::move(joints)),
      index_(joints_.size(), 0),
      q_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(joints_.size()))),
      dq_(q_),
      tau_(q_) {}

JointMap::Found JointMap::find() {
  concerned_ = -1;
  int missing = -1, twice = -1, there = 0;
  for (int i = 0; i < size(); ++i) {
    const auto at = std::find(names_.begin(), names_.end(), joints_[i]);
    if (at == names_.end()) {
      if (missing < 0) missing = i;
      continue;
    }
    ++there;
    if (twice < 0 && std::find(at + 1, names_.end(), joints_[i]) != names_.end()) twice = i;
    index_[i] = static_cast<std::size_t>(at - names_.begin());
  }
  if (there == 0) return Found::none;
  if (missing >= 0) {
    concerned_ = missing;
    return Found::missing;
  }
  concerned_ = twice;
  return twice >= 0 ? Found::twice : Found::all;
}

bool JointMap::take(const std::vector<double>& values, Eigen::VectorXd& out) noexcept {
  for (int i = 0; i < size(); ++i) {
    if (index_[i] >= values.size()) {
      joint_ = i;
      return false;
    }
    out[i] = values[index_[i]];
  }
  return true;
}

JointMap::Found JointMap::read(const sensor_msgs::JointState& message) noexcept {
  if (message.name != names_) {
    names_ = message.name;
    found_ = find();
  }
  joint_ = concerned_;
  if (found_ != Found::all) return found_;
  return take(message.position, q_) && take(message.velocity, dq_) && take(message.effort, tau_)
             ? Found::all
             : Found::incomplete;
}

}  // namespace dynid
