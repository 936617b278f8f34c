// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dynid {

// Each adds its subcommand to `app`; what it runs sets `status`, the program's exit status, or throws Error.
void add_init(CLI::App& app, int& status);
void add_info(CLI::App& app, int& status);
void add_identify(CLI::App& app, int& status);
void add_reverse(CLI::App& app, int& status);
void add_torque(CLI::App& app, int& status);
void add_replay(CLI::App& app, int& status);
void add_retrieve(CLI::App& app, int& status);
void add_bounds(CLI::App& app, int& status);
void add_excite(CLI::App& app, int& status);
void add_simulate(CLI::App& app, int& status);
void add_diagnose(CLI::App& app, int& status);
void add_compare(CLI::App& app, int& status);
void add_blind(CLI::App& app, int& status);
void add_export(CLI::App& app, int& status);
void add_demo(CLI::App& app, int& status);

/// All of them, in the order of the help.
inline void add_commands(CLI::App& app, int& status) {
  add_init(app, status);
  add_info(app, status);
  add_identify(app, status);
  add_reverse(app, status);
  add_torque(app, status);
  add_replay(app, status);
  add_retrieve(app, status);
  add_bounds(app, status);
  add_excite(app, status);
  add_simulate(app, status);
  add_diagnose(app, status);
  add_compare(app, status);
  add_blind(app, status);
  add_export(app, status);
  add_demo(app, status);
}

}  // namespace dynid
