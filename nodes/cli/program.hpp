// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// The command line: one file a subcommand in this folder. Takes SIGINT and SIGTERM for itself. Returns the
/// exit status; throws nothing.
int run_program(int argc, char** argv);

}  // namespace dynid
