// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ros/time.h>
#include <sensor_msgs/JointState.h>

#include <string>
#include <vector>

#include "dynid/signal/log.hpp"
#include "ros/command_recording.hpp"

namespace dynid {

enum class BagCompression { none, bz2, lz4 };

/// Reads the sensor_msgs/JointState of one topic of a rosbag (format 2.0, any compression) as a log:
/// position, velocity and effort become q, dq and tau; t counts from the first message's header.stamp, to the
/// nanosecond.
///
/// `joints`: the robot's, by name, base to tip; other joints and messages with none of the robot's are passed
/// over. `topic` with or without the leading slash. Of a bag that is not whole (no index, cut short, a
/// damaged part) what stands before the damage is read and `warning` is set to one line that says how much.
/// Throws Error, one line that names file and topic: no such topic (those there are listed), another type, no
/// message, stamps not set, and, with the number of the message, time that goes back and all that
/// JointStateReader refuses, or a quantity that is `required` and not sent, or not in every message.
Log read_bag(const std::string& path, const std::vector<std::string>& joints,
             const std::string& topic = "/joint_states", const LogColumns& required = {},
             std::string* warning = nullptr);

/// The same with commanded positions u of `command_topic`: a sensor_msgs/JointState or
/// trajectory_msgs/JointTrajectory (joints by name) or a std_msgs/Float64MultiArray (in the robot's order).
/// In each row the latest command that there was (see CommandRows); rows before the first command are left
/// out. Where headers of either topic have no stamps, both go by the time at which they were recorded. Throws
/// Error as read_bag(), and naming the command topic alike.
Log read_servo_bag(const std::string& path, const std::vector<std::string>& joints, const std::string& topic,
                   const std::string& command_topic, const LogColumns& required = {},
                   std::string* warning = nullptr);

/// Writes messages to a bag, stamped as they are, whole or not at all. Throws Error naming the path.
void write_bag(const std::string& path, const std::vector<sensor_msgs::JointState>& messages,
               const std::string& topic = "/joint_states", BagCompression compression = BagCompression::none);

/// Writes joint states and commands to a bag, each recorded at its arrival, whole or not at all:
/// read_servo_bag() reads it whether or not their headers are stamped. `arrivals`: of the states. Throws
/// Error naming the path.
void write_servo_bag(const std::string& path, const std::vector<sensor_msgs::JointState>& messages,
                     const std::vector<ros::Time>& arrivals, const std::string& topic,
                     const std::vector<AnyMessage>& commands, const std::string& command_topic,
                     BagCompression compression = BagCompression::none);

/// Writes t, q, dq and tau of a log (a JointState has no place for the rest) so that read_bag() gives them
/// back, t from 0 and to the nanosecond. Stamps start at 1 s: ROS takes 0 for not set. Throws Error naming
/// the path, also on sizes that do not match and a log without time.
void write_bag(const std::string& path, const Log& log, const std::vector<std::string>& joints,
               const std::string& topic = "/joint_states", BagCompression compression = BagCompression::none);

}  // namespace dynid
