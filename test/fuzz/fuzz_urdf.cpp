// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/urdf.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] { dynid::parse_urdf(text, "input"); });
}
