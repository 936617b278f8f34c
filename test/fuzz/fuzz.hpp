// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

#include "dynid/base/error.hpp"

// Every target is a reader of what people hand in, given arbitrary bytes: it reads them or throws
// dynid::Error in one line. Whatever else comes of it (another exception, a sanitizer's finding, a second of
// silence, a gigabyte of memory) is a defect.
namespace dynid::fuzz {

/// For readers of files: the input as one, in memory where the system has such a place.
inline const std::string& file_with(const std::uint8_t* data, std::size_t size, const char* suffix) {
  static const std::string path = [suffix] {
    const std::string folder = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
    return folder + "/dynid-fuzz-" + std::to_string(getpid()) + suffix;
  }();
  static const int at_exit = std::atexit([] { unlink(path.c_str()); });
  static_cast<void>(at_exit);
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  return path;
}

/// Reads; an Error whose text is not one line, or none, is a defect too.
template <class Read>
int expect_read_or_error(const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.empty() || text.find('\n') != std::string::npos) std::abort();
  }
  return 0;
}

}  // namespace dynid::fuzz
