// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/calibration.hpp"

#include "dynid/diagnosis/diagnose.hpp"
#include "fuzz.hpp"

// Fitting a calibration stands beside reading one, and would bring the whole diagnosis along; it is not
// called here.
const char* dynid::to_string(Verdict) { return ""; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  return dynid::fuzz::expect_read_or_error([&] { dynid::parse_calibration(text, "input"); });
}
