// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dynid {

/// Writes `text` to `path` whole or not at all: into a temporary file beside it, flushed, then renamed over
/// it. Throws Error naming the path and the system's reason; the old file, if any, is then untouched.
void write_file(const std::string& path, const std::string& text);

/// Throws Error when `path` could not be written by write_file() (missing folder, no permission): called
/// before a long computation, it changes nothing on disk.
void check_writable(const std::string& path);

/// The whole file as a string. Throws Error naming the path and the system's reason.
std::string read_file(const std::string& path);

}  // namespace dynid
