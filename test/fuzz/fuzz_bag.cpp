// SPDX-License-Identifier: Apache-2.0
// A rosbag with joint states, and as a servo has it, with commands beside them. Where ROS is found.
#include "fuzz.hpp"
#include "ros/bag.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string& path = dynid::fuzz::file_with(data, size, ".bag");
  static const std::vector<std::string> joints = {"shoulder", "elbow"};
  std::string warning;
  dynid::fuzz::expect_read_or_error([&] { dynid::read_bag(path, joints, "/joint_states", {}, &warning); });
  dynid::LogColumns few;
  few.t = few.dq = few.tau = false;
  return dynid::fuzz::expect_read_or_error(
      [&] { dynid::read_servo_bag(path, joints, "/joint_states", "/command", few, &warning); });
}
