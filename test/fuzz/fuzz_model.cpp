// SPDX-License-Identifier: Apache-2.0
// A model in YAML, which a patch is as well; what was read can be written, and is then read as the same
// robot.
#include <sstream>

#include "dynid/model/yaml.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] { dynid::parse_model(text, "input"); });
}
