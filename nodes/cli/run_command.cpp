// SPDX-License-Identifier: Apache-2.0
#include "cli/run_command.hpp"

#include <algorithm>

#include "cli/commands.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

int run(std::vector<std::string> words, bool only_check) {
  CLI::App app{"dynid", "dynid"};
  app.require_subcommand(1);
  int status = 0;
  add_commands(app, status);
  if (only_check)
    for (CLI::App* command : app.get_subcommands({})) command->callback([] {});
  const std::string name = words.empty() ? "" : words.front();
  std::reverse(words.begin(), words.end());  // as CLI11 takes them
  try {
    app.parse(words);
  } catch (const CLI::Error& error) {
    throw Error(name + ": " + error.what());
  }
  return status;
}

}  // namespace

int run_command(const std::vector<std::string>& words) { return run(words, false); }

void check_command(const std::vector<std::string>& words) { run(words, true); }

}  // namespace dynid
