// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/JointState.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dynid {

/// Finds a robot's joints by name in a stream of sensor_msgs/JointState, as a loop needs it: nothing is
/// thrown, and nothing is allocated while the names stay the same. (JointStateReader says in words what is
/// wrong.)
class JointMap {
 public:
  enum class Found {
    all,
    none,        ///< not one of the joints: another publisher's message
    missing,     ///< a joint is not there; joint() says which
    twice,       ///< a joint is there twice
    incomplete,  ///< position, velocity or effort is empty or ends before a joint
  };

  /// `joints`: as the messages name them, base to tip.
  explicit JointMap(std::vector<std::string> joints);

  /// Takes q [rad or m], dq and tau [N m or N], n each, out of a message; they are whole on `all` alone. The
  /// values may be anything, not a number included.
  Found read(const sensor_msgs::JointState& message) noexcept;

  int size() const noexcept { return static_cast<int>(joints_.size()); }
  const std::vector<std::string>& joints() const noexcept { return joints_; }
  int joint() const noexcept { return joint_; }  ///< which is concerned, from 0; -1: none
  const Eigen::VectorXd& q() const noexcept { return q_; }
  const Eigen::VectorXd& dq() const noexcept { return dq_; }
  const Eigen::VectorXd& tau() const noexcept { return tau_; }

 private:
  Found find();
  bool take(const std::vector<double>& values, Eigen::VectorXd& out) noexcept;

  std::vector<std::string> joints_, names_;
  std::vector<std::size_t> index_;  // of each joint in names_
  Found found_ = Found::none;       // in names_
  int joint_ = -1, concerned_ = -1;
  Eigen::VectorXd q_, dq_, tau_;
};

}  // namespace dynid
