// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/JointState.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace dynid {

/// A robot's joints in a stream of sensor_msgs/JointState: found by name, in any order, among any others.
class JointStateReader {
 public:
  /// `joints`: the robot's, base to tip.
  explicit JointStateReader(std::vector<std::string> joints);

  /// Takes the robot's joints out of a message; false where it has none of them (a gripper on the same
  /// topic). Throws Error in one line without the file or topic: a joint missing or named twice, position,
  /// velocity or effort of another length than name (the last two may be empty), a value that is not finite.
  /// Allocates only where the names are not those of the message before.
  bool read(const sensor_msgs::JointState& message);

  const std::vector<std::string>& joints() const noexcept { return joints_; }
  const Eigen::VectorXd& q() const noexcept { return q_; }      ///< n [rad or m], of the last read()
  const Eigen::VectorXd& dq() const noexcept { return dq_; }    ///< n [rad/s or m/s]; empty: not sent
  const Eigen::VectorXd& tau() const noexcept { return tau_; }  ///< n [N m or N]; empty: not sent

 private:
  void find(const std::vector<std::string>& names);
  void take(const char* what, const std::vector<double>& values, bool required, Eigen::VectorXd& out) const;

  std::vector<std::string> joints_, names_;
  std::vector<std::size_t> index_;  // of each joint among names_; empty where none is
  Eigen::VectorXd q_, dq_, tau_;
};

/// True where `size` bytes hold one sensor_msgs/JointState and nothing else: the lengths of a damaged message
/// can ask for any amount of memory, so they are looked at before it is deserialised.
bool is_joint_state(const std::uint8_t* data, std::size_t size) noexcept;

}  // namespace dynid
