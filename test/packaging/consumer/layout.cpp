// SPDX-License-Identifier: Apache-2.0
//
// Writes sizes and offsets into a header; compiled again for another vector unit, it compares its own with
// them.
#include <cstddef>
#include <fstream>

#include "dynid/model/robot.hpp"

constexpr std::size_t layout[] = {
    sizeof(dynid::StandardParameters),
    sizeof(dynid::LinkInertia),
    sizeof(dynid::Joint),
    alignof(dynid::Joint),
    offsetof(dynid::Joint, origin),
    offsetof(dynid::Joint, axis),
    offsetof(dynid::Joint, parameters),
    offsetof(dynid::Joint, rotor_inertia),
    sizeof(dynid::Robot),
    offsetof(dynid::Robot, tip),
    offsetof(dynid::Robot, gravity),
};
constexpr std::size_t count = sizeof(layout) / sizeof(layout[0]);

#ifdef DYNID_LAYOUT_HEADER
#include "layout.hpp"

constexpr bool alike() {
  for (std::size_t i = 0; i < count; ++i) {
    if (layout[i] != default_layout[i]) return false;
  }
  return true;
}
static_assert(alike(),
              "the layout of dynid's types depends on the vector unit that the program is compiled for");
#else
int main(int, char** argv) {
  std::ofstream file(argv[1]);
  file << "constexpr std::size_t default_layout[] = {";
  for (const std::size_t number : layout) file << number << ", ";
  file << "};\n";
  return file.good() ? 0 : 1;
}
#endif
