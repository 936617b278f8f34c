// SPDX-License-Identifier: Apache-2.0
#include "cli/program.hpp"

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>
#include <string>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

constexpr int bad_usage = 2;

}  // namespace

int run_program(int argc, char** argv) {
  CLI::App app{"dynid: the dynamics of a robot arm, identified", "dynid"};
  app.set_version_flag("--version", DYNID_VERSION);
  app.require_subcommand(1);
  app.footer("Run 'dynid COMMAND --help' for the options of a command and an example.");
  int status = 0;
  add_commands(app, status);
  listen_for_interrupts();
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& request) {  // --help, --version
    return app.exit(request);
  } catch (const CLI::ParseError& error) {
    std::cerr << "dynid: " << one_line(error.what()) << " (see --help)\n";
    return bad_usage;
  } catch (const Stopped&) {
    std::cerr << "dynid: interrupted, nothing was written\n";
    return interrupted_status();
  } catch (const OptionError& error) {
    std::cerr << "dynid: " << one_line(error.on_command_line()) << " (see --help)\n";
    return bad_usage;
  } catch (const Error& error) {
    std::cerr << "dynid: " << one_line(error.what()) << "\n";
    return bad_usage;
  } catch (const std::exception& error) {
    std::cerr << "dynid: " << one_line(error.what()) << "\n";
    return bad_usage;
  }
  return status;
}

}  // namespace dynid
