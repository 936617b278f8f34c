// SPDX-License-Identifier: Apache-2.0
// MJCF as it is made ready for MuJoCo, whose own reader is not looked at.
#include "dynid/model/mjcf.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] { dynid::parse_mjcf_text(text, "input"); });
}
