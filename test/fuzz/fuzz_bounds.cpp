// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/bounds.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string& path = dynid::fuzz::file_with(data, size, ".yaml");
  return dynid::fuzz::expect_read_or_error([&] { dynid::read_bounds(path); });
}
