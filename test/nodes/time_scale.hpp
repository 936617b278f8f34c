// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdlib>

namespace dynid::test {

/// How many times as long as usual a test may wait (DYNID_TIME_SCALE, 1): under sanitizers programs are many
/// times as slow.
inline double time_scale() {
  const char* text = std::getenv("DYNID_TIME_SCALE");
  return text != nullptr ? std::max(1.0, std::atof(text)) : 1.0;
}

}  // namespace dynid::test
