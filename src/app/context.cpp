// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/context.hpp"

namespace dynid {

Context Context::part(double from, double to) const {
  Context inner;
  inner.stop = stop;
  if (progress)
    inner.progress = [whole = progress, from, to](const std::string& stage, double fraction) {
      whole(stage, from + (to - from) * fraction);
    };
  return inner;
}

}  // namespace dynid
