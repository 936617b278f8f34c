// SPDX-License-Identifier: Apache-2.0
// A log: with velocities and torques, and as a servo has it, with neither.
#include "dynid/signal/log.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string& path = dynid::fuzz::file_with(data, size, ".csv");
  dynid::LogColumns few;
  few.t = few.dq = few.tau = false;
  dynid::fuzz::expect_read_or_error([&] { dynid::read_log(path, 0, few); });
  return dynid::fuzz::expect_read_or_error([&] { dynid::read_log(path); });
}
