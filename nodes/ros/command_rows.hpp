// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace dynid {

/// Commanded positions of a robot's joints out of serialised messages of one topic: sensor_msgs/JointState,
/// trajectory_msgs/JointTrajectory (joints by name) or std_msgs/Float64MultiArray (in the robot's order).
/// A trajectory of one point is a command at once; of several points each is one at its time_from_start, and
/// a later message takes the place of what was still to come.
class CommandRows {
 public:
  /// `joints`: the robot's, base to tip.
  explicit CommandRows(std::vector<std::string> joints) : joints_(std::move(joints)) {}

  /// The types and their checksums, by name.
  static const std::map<std::string, std::string>& types();

  /// A message of that type; `arrival` [ns] is when it was recorded. Throws std::runtime_error where the
  /// bytes are not such a message, Error naming the joint that is not commanded or whose command is not
  /// finite.
  void add(const std::string& type, std::uint8_t* data, std::size_t size, std::int64_t arrival);

  std::size_t messages() const noexcept { return messages_; }
  /// Headers have stamps; else commands go by their arrival.
  bool stamped() const noexcept { return stamped_; }
  /// The commands that hold at `times` [ns], not decreasing, by headers or, with `by_arrival`, by arrival;
  /// the first `unheard` of the rows have none yet. N x n.
  Eigen::MatrixXd at(const std::vector<std::int64_t>& times, bool by_arrival, Eigen::Index& unheard) const;

 private:
  void take(const std::vector<std::string>& names, const std::vector<double>& values, std::int64_t stamp,
            std::int64_t arrival, std::int64_t later);

  struct Command {
    std::int64_t stamp, arrival;  // [ns] of the message
    std::int64_t later;           // [ns] after it
    std::vector<double> u;
  };
  std::vector<std::string> joints_;
  std::vector<Command> commands_;
  std::size_t messages_ = 0;
  bool stamped_ = false;
};

}  // namespace dynid
