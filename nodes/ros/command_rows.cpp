// SPDX-License-Identifier: Apache-2.0
#include "ros/command_rows.hpp"

#include <ros/serialization.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "dynid/base/error.hpp"
#include "ros/joint_state.hpp"

namespace dynid {
namespace {

/// Walks over a message: a damaged length can ask for any amount of memory, so all are looked at before it is
/// deserialised.
class Walk {
 public:
  Walk(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  bool bytes(std::size_t n) {
    if (size_ - at_ < n) return false;
    at_ += n;
    return true;
  }
  bool number(std::uint32_t& n) {
    if (size_ - at_ < sizeof n) return false;
    std::memcpy(&n, data_ + at_, sizeof n);
    return bytes(sizeof n);
  }
  bool array(std::size_t width) {  // of `width` bytes an entry
    std::uint32_t n = 0;
    return number(n) && (size_ - at_) / width >= n && bytes(n * width);
  }
  bool names() {
    std::uint32_t n = 0;
    if (!number(n)) return false;
    for (std::uint32_t i = 0; i < n; ++i)
      if (!array(1)) return false;
    return true;
  }
  bool end() const { return at_ == size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

bool is_trajectory(const std::uint8_t* data, std::size_t size) {
  Walk walk(data, size);
  std::uint32_t points = 0;
  if (!walk.bytes(12) || !walk.array(1) || !walk.names() || !walk.number(points)) return false;
  for (std::uint32_t i = 0; i < points; ++i) {
    for (int k = 0; k < 4; ++k)  // positions, velocities, accelerations, effort
      if (!walk.array(sizeof(double))) return false;
    if (!walk.bytes(8)) return false;
  }
  return walk.end();
}

bool is_array(const std::uint8_t* data, std::size_t size) {
  Walk walk(data, size);
  std::uint32_t dimensions = 0;
  if (!walk.number(dimensions)) return false;
  for (std::uint32_t i = 0; i < dimensions; ++i)
    if (!walk.array(1) || !walk.bytes(8)) return false;
  return walk.bytes(4) && walk.array(sizeof(double)) && walk.end();
}

template <class Message>
Message read(std::uint8_t* data, std::size_t size) {
  Message message;
  ros::serialization::IStream stream(data, static_cast<std::uint32_t>(size));
  ros::serialization::deserialize(stream, message);
  return message;
}

template <class Message>
void put_type(std::map<std::string, std::string>& types) {
  types[ros::message_traits::DataType<Message>::value()] = ros::message_traits::MD5Sum<Message>::value();
}

std::int64_t nanoseconds(const ros::Time& stamp) {
  return std::int64_t(stamp.sec) * 1000000000 + std::int64_t(stamp.nsec);
}

}  // namespace

const std::map<std::string, std::string>& CommandRows::types() {
  static const std::map<std::string, std::string> all = [] {
    std::map<std::string, std::string> types;
    put_type<sensor_msgs::JointState>(types);
    put_type<trajectory_msgs::JointTrajectory>(types);
    put_type<std_msgs::Float64MultiArray>(types);
    return types;
  }();
  return all;
}

void CommandRows::add(const std::string& type, std::uint8_t* data, std::size_t size, std::int64_t arrival) {
  ++messages_;
  const auto damaged = [] { return std::runtime_error("a damaged message"); };
  if (type == ros::message_traits::DataType<std_msgs::Float64MultiArray>::value()) {
    if (!is_array(data, size)) throw damaged();
    take(joints_, read<std_msgs::Float64MultiArray>(data, size).data, 0, arrival, 0);
  } else if (type == ros::message_traits::DataType<trajectory_msgs::JointTrajectory>::value()) {
    if (!is_trajectory(data, size)) throw damaged();
    const auto message = read<trajectory_msgs::JointTrajectory>(data, size);
    const bool plan = message.points.size() > 1;
    for (const trajectory_msgs::JointTrajectoryPoint& point : message.points)
      take(message.joint_names, point.positions, nanoseconds(message.header.stamp), arrival,
           plan ? point.time_from_start.toNSec() : 0);
  } else {
    if (!is_joint_state(data, size)) throw damaged();
    const auto message = read<sensor_msgs::JointState>(data, size);
    take(message.name, message.position, nanoseconds(message.header.stamp), arrival, 0);
  }
}

void CommandRows::take(const std::vector<std::string>& names, const std::vector<double>& values,
                       std::int64_t stamp, std::int64_t arrival, std::int64_t later) {
  const std::string where = "message " + std::to_string(messages_) + ": ";
  if (values.size() != names.size())
    throw Error(where + std::to_string(values.size()) + " positions for " + std::to_string(names.size()) +
                " joints");
  Command command{stamp, arrival, later, {}};
  for (const std::string& joint : joints_) {
    const auto at = std::find(names.begin(), names.end(), joint);
    if (at == names.end()) throw Error(where + "joint '" + joint + "' is not commanded");
    const double u = values[static_cast<std::size_t>(at - names.begin())];
    if (!std::isfinite(u)) throw Error(where + "the command of joint '" + joint + "' is not finite");
    command.u.push_back(u);
  }
  stamped_ = stamped_ || stamp != 0;
  commands_.push_back(std::move(command));
}

Eigen::MatrixXd CommandRows::at(const std::vector<std::int64_t>& times, bool by_arrival,
                                Eigen::Index& unheard) const {
  const auto begins = [&](const Command& c) { return by_arrival ? c.arrival : c.stamp; };
  // What was still to come when a later message came never was.
  std::vector<const Command*> heard;
  for (const Command& c : commands_) {
    while (!heard.empty() && begins(*heard.back()) != begins(c) &&
           begins(*heard.back()) + heard.back()->later >= begins(c))
      heard.pop_back();
    heard.push_back(&c);
  }
  Eigen::MatrixXd u(static_cast<Eigen::Index>(times.size()), static_cast<Eigen::Index>(joints_.size()));
  unheard = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    while (next < heard.size() && begins(*heard[next]) + heard[next]->later <= times[i]) ++next;
    const auto row = static_cast<Eigen::Index>(i);
    if (next == 0) {
      unheard = row + 1;
      u.row(row).setZero();
    } else {
      u.row(row) = Eigen::Map<const Eigen::RowVectorXd>(heard[next - 1]->u.data(), u.cols());
    }
  }
  return u;
}

}  // namespace dynid
