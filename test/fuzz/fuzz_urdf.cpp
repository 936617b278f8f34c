// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/urdf.hpp"
#include "fuzz.hpp"

// Joints in a circle are a parent each of the next: urdfdom, which refuses them, lets go of none.
extern "C" const char* __lsan_default_suppressions() { return "leak:liburdfdom_model\n"; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] { dynid::parse_urdf(text, "input"); });
}
