// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

namespace dynid {

/// From now on the first SIGINT (Ctrl-C) or SIGTERM asks the command to end: it sets stop_requested(), and
/// the command ends where it next looks, with nothing written. A second one ends the program at once.
void listen_for_interrupts();

/// For Context::stop.
const std::atomic<bool>& stop_requested();

/// 128 and the number of the signal, as shells have it: 130 after Ctrl-C.
int interrupted_status();

}  // namespace dynid
