// SPDX-License-Identifier: Apache-2.0
// A model in YAML, which a patch is as well. What was read can be written, and that can be read.
#include <cstdio>

#include "dynid/model/yaml.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] {
    const dynid::ModelFile model = dynid::parse_model(text, "input");
    std::string again;
    try {
      again = dynid::to_yaml(model);
      dynid::parse_model(again, "again");
    } catch (const dynid::Error& error) {
      std::fprintf(stderr, "%s\n%s\n", error.what(), again.c_str());
      std::abort();
    }
  });
}
