// SPDX-License-Identifier: Apache-2.0
#include "dynid/commands.hpp"
namespace dynid {
void add_demo(CLI::App&, int&) {}
}  // namespace dynid
