// SPDX-License-Identifier: Apache-2.0
//
// Servo logs in rosbags: joint states and commands on a topic of their own, of any of three types.
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/String.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "ros/bag.hpp"
#include "ros/command_recording.hpp"

namespace dynid {
namespace {

const std::vector<std::string> joints = {"lift", "pan"};
constexpr int rows = 200;
constexpr double period = 0.02;

double command(int joint, double t) { return std::sin((joint + 1.0) * t); }

class CommandBag : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = (std::filesystem::path(::testing::TempDir()) /
             (std::string("dynid_command_") + info->name() + ".bag"))
                .string();
  }
  void TearDown() override { std::filesystem::remove(path_); }

  /// Joint states, and 5 ms before each what `write` puts in.
  template <class Write>
  void record(bool stamps, const Write& write, int first_command = 0) const {
    rosbag::Bag bag(path_, rosbag::bagmode::Write);
    for (int i = 0; i < rows; ++i) {
      const double t = 1.0 + i * period;
      if (i >= first_command) write(bag, ros::Time(t - 0.005), t - 1.0);
      sensor_msgs::JointState state;
      if (stamps) state.header.stamp = ros::Time(t);
      state.name = {"gripper", "pan", "lift"};
      state.position = {9.0, 10.0 + i, 20.0 + i};
      bag.write("/joint_states", ros::Time(t), state);
    }
    bag.close();
  }
  static void expect_commands(const Log& log, int first = 0) {
    ASSERT_EQ(log.samples(), rows - first);
    ASSERT_EQ(log.u.rows(), log.samples());
    EXPECT_EQ(log.t[0], 0.0);
    EXPECT_NEAR(log.t[log.samples() - 1], (rows - 1 - first) * period, 1e-6);
    for (Eigen::Index i = 0; i < log.samples(); ++i) {
      const double t = double(i + first) * period;
      EXPECT_NEAR(log.u(i, 0), command(0, t), 1e-9);  // lift
      EXPECT_NEAR(log.u(i, 1), command(1, t), 1e-9);  // pan
      EXPECT_EQ(log.q(i, 0), 20.0 + double(i + first));
      EXPECT_EQ(log.q(i, 1), 10.0 + double(i + first));
    }
  }
  Log read() const {
    LogColumns columns;
    columns.dq = columns.tau = false;
    return read_servo_bag(path_, joints, "/joint_states", "arm/command", columns);
  }
  std::string refusal() const {
    try {
      read();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::string path_;
};

TEST_F(CommandBag, OfJointStates) {
  record(true, [](rosbag::Bag& bag, ros::Time at, double t) {
    sensor_msgs::JointState m;
    m.header.stamp = at;
    m.name = {"pan", "lift"};
    m.position = {command(1, t), command(0, t)};
    bag.write("/arm/command", at, m);
  });
  expect_commands(read());
}

TEST_F(CommandBag, OfTrajectoriesOfOnePoint) {
  record(true, [](rosbag::Bag& bag, ros::Time at, double t) {
    trajectory_msgs::JointTrajectory m;
    m.header.stamp = at;
    m.joint_names = {"pan", "lift"};
    m.points.resize(1);
    m.points[0].positions = {command(1, t), command(0, t)};
    m.points[0].time_from_start = ros::Duration(0.5);  // a goal is a command at once
    bag.write("/arm/command", at, m);
  });
  expect_commands(read());
}

// A plan is commands at its points' times, until another takes its place.
TEST_F(CommandBag, OfAPlan) {
  record(true, [](rosbag::Bag& bag, ros::Time at, double t) {
    const int row = static_cast<int>(std::lround(t / period));
    if (row % 50 != 0) return;
    trajectory_msgs::JointTrajectory m;
    m.header.stamp = at;
    m.joint_names = {"lift", "pan"};
    for (int k = 0; k < 80; ++k) {  // longer than until the next
      trajectory_msgs::JointTrajectoryPoint p;
      const double then = t + k * period;
      p.positions = {command(0, then), command(1, then)};
      p.time_from_start = ros::Duration(k * period);
      m.points.push_back(p);
    }
    bag.write("/arm/command", at, m);
  });
  expect_commands(read());
}

// No stamps: both topics go by when they were recorded. Rows before the first command have none.
TEST_F(CommandBag, OfArraysByArrival) {
  for (const bool stamps : {true, false}) {
    record(
        stamps,
        [](rosbag::Bag& bag, ros::Time at, double t) {
          std_msgs::Float64MultiArray m;
          m.data = {command(0, t), command(1, t)};
          bag.write("/arm/command", at, m);
        },
        30);
    expect_commands(read(), 30);
  }
}

template <class Message>
AnyMessage as_it_comes(const Message& message) {
  AnyMessage any;
  any.type = ros::message_traits::datatype(message);
  any.md5sum = ros::message_traits::md5sum(message);
  any.definition = ros::message_traits::definition(message);
  any.bytes.resize(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(any.bytes.data(), static_cast<std::uint32_t>(any.bytes.size()));
  ros::serialization::serialize(stream, message);
  return any;
}

// What a node recorded: headers with stamps or without, commands of a type that says nothing of time.
TEST_F(CommandBag, OfARecording) {
  for (const bool stamps : {true, false}) {
    CommandRecording commands;
    const auto array = [](double pan, double lift) {
      std_msgs::Float64MultiArray m;
      m.data.push_back(pan);
      m.data.push_back(lift);
      return as_it_comes(m);
    };
    commands.add(array(7.0, 7.0), ros::Time(0.5));  // before it runs
    commands.start();
    std::vector<sensor_msgs::JointState> states;
    std::vector<ros::Time> arrivals;
    for (int i = 0; i < rows; ++i) {
      const double t = i * period;
      if (i >= 30) commands.add(array(command(0, t), command(1, t)), ros::Time(1.0 + t - 0.005));
      sensor_msgs::JointState state;
      if (stamps) state.header.stamp = ros::Time(100.0 + t);  // of another clock
      state.name = {"pan", "lift"};
      state.position = {10.0 + i, 20.0 + i};
      states.push_back(state);
      arrivals.emplace_back(1.0 + t);
    }
    commands.stop();
    commands.add(array(7.0, 7.0), ros::Time(50.0));
    EXPECT_EQ(commands.summary().messages, std::size_t(rows - 30));
    EXPECT_EQ(commands.summary().dropped, 0u);
    write_servo_bag(path_, states, arrivals, "/joint_states", commands.messages(), "/arm/command",
                    BagCompression::lz4);
    expect_commands(read(), 30);
  }
}

TEST_F(CommandBag, ARecordingDropsWhatIsNoCommand) {
  CommandRecording commands;
  commands.start();
  commands.add(as_it_comes(std_msgs::String()), ros::Time(1.0));
  AnyMessage other = as_it_comes(std_msgs::Float64MultiArray());
  other.md5sum = "of another version";
  commands.add(other, ros::Time(1.0));
  EXPECT_EQ(commands.summary().messages, 0u);
  EXPECT_EQ(commands.summary().dropped, 2u);
  EXPECT_NE(commands.summary().first_drop.find("it is std_msgs/String, not "), std::string::npos);
  commands.start();  // forgets
  EXPECT_EQ(commands.summary().dropped, 0u);
}

TEST_F(CommandBag, IsRefusedInOneLine) {
  const auto with = [&](const std::vector<std::string>& names, const std::vector<double>& positions) {
    record(true, [&](rosbag::Bag& bag, ros::Time at, double) {
      sensor_msgs::JointState m;
      m.header.stamp = at;
      m.name = names;
      m.position = positions;
      bag.write("/arm/command", at, m);
    });
    return refusal();
  };
  EXPECT_NE(with({"lift"}, {1.0}).find("joint 'pan' is not commanded"), std::string::npos);
  EXPECT_NE(with({"lift", "pan"}, {1.0}).find("1 positions for 2 joints"), std::string::npos);
  EXPECT_NE(with({"lift", "pan"}, {1.0, NAN}).find("is not finite"), std::string::npos);
  record(true,
         [](rosbag::Bag& bag, ros::Time at, double) { bag.write("/arm/command", at, std_msgs::String()); });
  EXPECT_NE(refusal().find("is std_msgs/String, not "), std::string::npos) << refusal();
  record(true, [](rosbag::Bag&, ros::Time, double) {});
  EXPECT_NE(refusal().find("topic arm/command is not in the bag; there are /joint_states"), std::string::npos)
      << refusal();
}

TEST_F(CommandBag, DamagedInAnyByteNeverCrashes) {
  record(true, [](rosbag::Bag& bag, ros::Time at, double t) {
    trajectory_msgs::JointTrajectory m;
    m.header.stamp = at;
    m.joint_names = {"pan", "lift"};
    m.points.resize(2);
    m.points[0].positions = m.points[1].positions = {command(1, t), command(0, t)};
    bag.write("/arm/command", at, m);
  });
  const std::string whole = read_file(path_);
  std::mt19937 random(5);
  for (int k = 0; k < 300; ++k) {
    std::string bytes = whole;
    for (int n = 0; n < 3; ++n) bytes[random() % bytes.size()] = static_cast<char>(random());
    std::ofstream(path_, std::ios::binary) << bytes;
    try {
      read();
    } catch (const Error&) {
    }
  }
}

}  // namespace
}  // namespace dynid
