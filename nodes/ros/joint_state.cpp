// SPDX-License-Identifier: Apache-2.0
#include "ros/joint_state.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "dynid/base/error.hpp"

namespace dynid {

JointStateReader::JointStateReader(std::vector<std::string> joints) : joints_(std::move(joints)) {}

void JointStateReader::find(const std::vector<std::string>& names) {
  std::vector<std::size_t> index;
  std::string missing;
  for (const std::string& joint : joints_) {
    const auto at = std::find(names.begin(), names.end(), joint);
    if (at == names.end()) {
      if (missing.empty()) missing = joint;
      continue;
    }
    if (std::find(at + 1, names.end(), joint) != names.end())
      throw Error("joint '" + joint + "' is named twice");
    index.push_back(static_cast<std::size_t>(at - names.begin()));
  }
  if (!index.empty() && !missing.empty()) throw Error("joint '" + missing + "' is missing");
  index_ = std::move(index);
  names_ = names;
}

void JointStateReader::take(const char* what, const std::vector<double>& values, bool required,
                            Eigen::VectorXd& out) const {
  if (values.empty() && !required) {
    out.resize(0);
    return;
  }
  if (values.size() != names_.size())
    throw Error(std::string(what) + " has " + std::to_string(values.size()) + " entries for " +
                std::to_string(names_.size()) + " names");
  out.resize(static_cast<Eigen::Index>(index_.size()));
  for (std::size_t j = 0; j < index_.size(); ++j) {
    const double x = values[index_[j]];
    if (!std::isfinite(x)) throw Error(std::string(what) + " of joint '" + joints_[j] + "' is not finite");
    out[static_cast<Eigen::Index>(j)] = x;
  }
}

bool JointStateReader::read(const sensor_msgs::JointState& message) {
  if (message.name != names_) find(message.name);
  if (index_.empty()) return false;
  take("position", message.position, true, q_);
  take("velocity", message.velocity, false, dq_);
  take("effort", message.effort, false, tau_);
  return true;
}

bool is_joint_state(const std::uint8_t* data, std::size_t size) noexcept {
  std::size_t at = 0;
  const auto number = [&](std::uint32_t& n) {
    if (size - at < sizeof n) return false;
    std::memcpy(&n, data + at, sizeof n);
    at += sizeof n;
    return true;
  };
  const auto skip = [&](std::size_t width) {  // an array of `width` bytes an entry
    std::uint32_t n = 0;
    if (!number(n) || (size - at) / width < n) return false;
    at += n * width;
    return true;
  };
  if (size < 12) return false;
  at = 12;  // seq and stamp
  std::uint32_t names = 0;
  if (!skip(1) || !number(names)) return false;
  for (std::uint32_t i = 0; i < names; ++i)
    if (!skip(1)) return false;
  for (int array = 0; array < 3; ++array)  // position, velocity, effort
    if (!skip(sizeof(double))) return false;
  return at == size;
}

}  // namespace dynid
