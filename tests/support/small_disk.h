// A file system of a few megabytes in memory (tmpfs), for tests of a disk that is really full. Mounted in a
// namespace of the test program's own, so nothing outside sees it. Works as root, and where unprivileged user
// namespaces are allowed; mounted() tells.
#pragma once

#include <cstdint>
#include <fcntl.h>
#include <fstream>
#include <sched.h>
#include <string>
#include <sys/mount.h>
#include <unistd.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::test {

class SmallDisk {
 public:
  explicit SmallDisk(std::uint64_t bytes) {
    const std::string options = "size=" + std::to_string(bytes);
    mounted_ = enter_own_namespace() && ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
               ::mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, options.c_str()) == 0;
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  ~SmallDisk() {
    if (mounted_) {
      ::umount2(folder_.path().c_str(), MNT_DETACH);
    }
  }
  [[nodiscard]] bool mounted() const { return mounted_; }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

  /// Takes what is free, to the last byte, with a file called `name`.
  void fill(const std::string& name) const {
    const int file = ::open((path() / name).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    std::string block(4096, 'x');
    while (!block.empty()) {
      if (::write(file, block.data(), block.size()) <= 0) {
        block.resize(block.size() / 2);
      }
    }
    ::close(file);
  }

 private:
  static bool enter_own_namespace() {
    if (::geteuid() == 0) {
      return ::unshare(CLONE_NEWNS) == 0;
    }
    const auto user = std::to_string(::geteuid());
    if (::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) {
      return false;
    }
    std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
    return ::geteuid() == 0;
  }

  TemporaryFolder folder_;
  bool mounted_ = false;
};

}  // namespace kiroku::test
