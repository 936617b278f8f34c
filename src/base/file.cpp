// SPDX-License-Identifier: Apache-2.0
#include "dynid/base/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "dynid/base/error.hpp"

namespace dynid {
namespace {

[[noreturn]] void fail(const std::string& path, const char* doing, int error) {
  throw Error(path + ": cannot " + doing + ": " + std::strerror(error));
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int close() {
    const int result = ::close(fd_);
    fd_ = -1;
    return result;
  }

 private:
  int fd_;
};

/// Where `path` really lies: a symbolic link is written through, not replaced.
std::string resolved(const std::string& path) {
  char* real = ::realpath(path.c_str(), nullptr);
  if (real == nullptr) return path;
  std::string result(real);
  std::free(real);
  return result;
}

std::string folder(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

/// 0, or the errno with which writing `path` would fail.
int obstacle(const std::string& path) {
  struct stat status {};
  if (path.empty()) return ENOENT;
  if (::stat(path.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) return EISDIR;
    if (::access(path.c_str(), W_OK) != 0) return errno;
    if (!S_ISREG(status.st_mode)) return 0;  // a device or a pipe: nothing is created beside it
  } else if (errno != ENOENT) {
    return errno;
  }
  if (path.back() == '/') return EISDIR;
  const std::string parent = folder(path);
  if (::stat(parent.c_str(), &status) != 0) return errno;
  if (!S_ISDIR(status.st_mode)) return ENOTDIR;
  return ::access(parent.c_str(), W_OK | X_OK) == 0 ? 0 : errno;
}

/// 0 or an errno.
int write_all(int fd, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::write(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno != EINTR) return errno;
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  return 0;
}

/// Creates a file that did not exist, with the permissions that the umask allows.
int create_beside(const std::string& path, std::string& temporary) {
  static std::atomic<unsigned> counter{0};
  for (;;) {
    temporary = path + ".tmp" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
    const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
}

}  // namespace

void write_file(const std::string& path, const std::string& text) {
  check_writable(path);
  const std::string target = resolved(path);
  struct stat old {};
  const bool exists = ::stat(target.c_str(), &old) == 0;
  if (exists && !S_ISREG(old.st_mode)) {
    Descriptor file(::open(target.c_str(), O_WRONLY | O_CLOEXEC));
    const int error = file.get() < 0 ? errno : write_all(file.get(), text);
    if (error != 0) fail(path, "write", error);
    return;
  }
  std::string temporary;
  Descriptor file(create_beside(target, temporary));
  if (file.get() < 0) fail(path, "write", errno);
  int error = write_all(file.get(), text);
  if (error == 0 && exists && ::fchmod(file.get(), old.st_mode & 07777) != 0) error = errno;
  if (error == 0 && ::fsync(file.get()) != 0) error = errno;
  if (file.close() != 0 && error == 0) error = errno;
  if (error == 0 && ::rename(temporary.c_str(), target.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(temporary.c_str());
    fail(path, "write", error);
  }
}

void check_writable(const std::string& path) {
  const int error = obstacle(path);
  if (error != 0) fail(path, "write", error);
}

std::string read_file(const std::string& path) {
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) fail(path, "read", errno);
  std::string text;
  char buffer[1 << 16];
  for (;;) {
    const ssize_t n = ::read(file.get(), buffer, sizeof buffer);
    if (n == 0) return text;
    if (n > 0) {
      text.append(buffer, static_cast<std::size_t>(n));
    } else if (errno != EINTR) {
      fail(path, "read", errno);
    }
  }
}

}  // namespace dynid
