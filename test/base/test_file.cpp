// SPDX-License-Identifier: Apache-2.0
#include "dynid/base/file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>

#include "model/random_robot.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using test::error_of;

class File : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "dynid-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder = pattern;
  }
  void TearDown() override { fs::remove_all(folder); }

  std::string at(const std::string& name) const { return (folder / name).string(); }
  long entries() const { return std::distance(fs::directory_iterator(folder), fs::directory_iterator()); }
  static unsigned mode(const std::string& path) {
    struct stat status {};
    ::stat(path.c_str(), &status);
    return status.st_mode & 0777;
  }

  fs::path folder;
};

TEST_F(File, WritesAndReadsAnyBytes) {
  const std::string text = std::string("one\ntwo\0three\r\n", 15) + std::string(200000, 'x');
  write_file(at("a"), text);
  EXPECT_EQ(read_file(at("a")), text);
  write_file(at("a"), "");
  EXPECT_EQ(read_file(at("a")), "");
  EXPECT_EQ(entries(), 1);
}

TEST_F(File, NewFilesFollowTheUmaskAndOldOnesKeepTheirMode) {
  const mode_t before = ::umask(027);
  write_file(at("new"), "x");
  ::umask(before);
  EXPECT_EQ(mode(at("new")), 0640U);
  ::chmod(at("new").c_str(), 0604);
  write_file(at("new"), "y");
  EXPECT_EQ(mode(at("new")), 0604U);
}

TEST_F(File, WritesThroughALink) {
  write_file(at("target"), "old");
  fs::create_symlink("target", folder / "link");
  write_file(at("link"), "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(at("target")), "new");
}

TEST_F(File, RefusesWhatCannotBeWrittenAndChangesNothing) {
  fs::create_directory(folder / "directory");
  const std::pair<std::string, std::string> cases[] = {
      {at("missing/a"), at("missing/a") + ": cannot write: No such file or directory"},
      {at("directory"), at("directory") + ": cannot write: Is a directory"},
      {at("new/"), at("new/") + ": cannot write: Is a directory"},
      {"", ": cannot write: No such file or directory"},
  };
  for (const auto& [path, message] : cases) {
    EXPECT_EQ(error_of([&, p = path] { check_writable(p); }), message);
    EXPECT_EQ(error_of([&, p = path] { write_file(p, "x"); }), message);
  }
  check_writable(at("fine"));
  EXPECT_EQ(entries(), 1);
}

TEST_F(File, LeavesTheOldFileWhenWritingFailsHalfWay) {
  write_file(at("a"), "old");
  struct rlimit before {};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  struct rlimit tight = before;
  tight.rlim_cur = 1000;
  ::setrlimit(RLIMIT_FSIZE, &tight);
  const std::string error = error_of([&] { write_file(at("a"), std::string(100000, 'x')); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(error, at("a") + ": cannot write: File too large");
  EXPECT_EQ(read_file(at("a")), "old");
  EXPECT_EQ(entries(), 1);
}

TEST_F(File, ADeviceIsWrittenAndNotReplaced) {
  write_file("/dev/null", "x");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  if (fs::exists("/dev/full")) {
    EXPECT_EQ(error_of([] { write_file("/dev/full", "x"); }),
              "/dev/full: cannot write: No space left on device");
  }
}

TEST_F(File, ReadingSaysWhyNot) {
  EXPECT_EQ(error_of([&] { read_file(at("none")); }),
            at("none") + ": cannot read: No such file or directory");
  EXPECT_EQ(error_of([&] { read_file(folder.string()); }), folder.string() + ": cannot read: Is a directory");
}

}  // namespace
}  // namespace dynid
