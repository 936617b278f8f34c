// SPDX-License-Identifier: Apache-2.0
// A diagnosis in JSON, compared with itself: it is what it is, and the page of it can be made.
#include "dynid/app/compare.hpp"
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] {
    const dynid::CompareReport report = run(dynid::CompareJob{{{"a", text}, {"b", text}}});
    report.html("command", "version");
  });
}
