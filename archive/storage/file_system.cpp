#include "archive/storage/file_system.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "archive/format/case_layout.h"
#include "base/descriptor.h"
#include "base/write_behind.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr mode_t kFileMode = 0644;
constexpr mode_t kFolderMode = 0755;

/// Repeats a system call that a signal interrupted.
template <typename Call>
auto uninterrupted(Call call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) {
      return result;
    }
  }
}

int open_file(const fs::path& file, int flags, const std::string& action) {
  const int number =
      uninterrupted([&] { return ::open(file.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, kFileMode); });
  if (number < 0) {
    throw IoError(action, file, errno);
  }
  return number;
}

class RealFile final : public WritableFile {
 public:
  RealFile(fs::path file, int number) : file_(std::move(file)), descriptor_(number), behind_(number) {}

  void write(ByteView bytes) override {
    while (!bytes.empty()) {
      const ssize_t count =
          uninterrupted([&] { return ::write(descriptor_.number(), bytes.data(), bytes.size()); });
      if (count < 0) {
        throw IoError("write", file_, errno);
      }
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
  }

  // fdatasync and fsync are not repeated after EINTR either: whether pages were dropped is not known then.
  void sync() override {
    if (::fdatasync(descriptor_.number()) != 0) {
      throw SyncError("flush", file_, errno);
    }
  }

  void sync_all() override {
    if (::fsync(descriptor_.number()) != 0) {
      throw SyncError("flush", file_, errno);
    }
  }

  void reserve(std::uint64_t bytes) override {
    const off_t from = size();
    const int result = uninterrupted([&] {
      return ::fallocate(descriptor_.number(), FALLOC_FL_KEEP_SIZE, from, static_cast<off_t>(bytes));
    });
    if (result != 0 && errno != EOPNOTSUPP && errno != ENOSYS) {
      throw IoError("allocate space for", file_, errno);
    }
  }

  void write_behind() override { behind_.wrote_until(static_cast<std::uint64_t>(size())); }

  void truncate(std::uint64_t size) override {
    const auto length = static_cast<off_t>(size);
    if (uninterrupted([&] { return ::ftruncate(descriptor_.number(), length); }) != 0) {
      throw IoError("change the size of", file_, errno);
    }
  }

  bool try_lock() override {
    if (uninterrupted([&] { return ::flock(descriptor_.number(), LOCK_EX | LOCK_NB); }) == 0) {
      return true;
    }
    if (errno == EWOULDBLOCK) {
      return false;
    }
    throw IoError("lock", file_, errno);
  }

  bool lock(std::chrono::milliseconds patience) override {
    constexpr std::chrono::milliseconds kFirstPause{1}, kLongestPause{20};
    const auto deadline = std::chrono::steady_clock::now() + patience;
    for (auto pause = kFirstPause; !try_lock(); pause = std::min(2 * pause, kLongestPause)) {
      if (std::chrono::steady_clock::now() >= deadline) {
        return false;
      }
      std::this_thread::sleep_for(pause);
    }
    return true;
  }

  void unlock() noexcept override { ::flock(descriptor_.number(), LOCK_UN); }

 private:
  /// Asked each time: another process may append to the appliance log's ledger.
  [[nodiscard]] off_t size() const {
    struct stat status {};
    if (::fstat(descriptor_.number(), &status) != 0) {
      throw IoError("examine", file_, errno);
    }
    return status.st_size;
  }

  fs::path file_;
  Descriptor descriptor_;
  WriteBehind behind_;
};

class RealFileSystem final : public FileSystem {
 public:
  std::unique_ptr<WritableFile> create(const fs::path& file) override {
    return std::make_unique<RealFile>(file, open_file(file, O_WRONLY | O_CREAT | O_EXCL | O_APPEND, "make"));
  }

  std::unique_ptr<WritableFile> append_to(const fs::path& file) override {
    return std::make_unique<RealFile>(file, open_file(file, O_WRONLY | O_APPEND, "open for writing"));
  }

  void rename(const fs::path& from, const fs::path& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) {
      throw IoError("give its final name to", from, errno);
    }
  }

  void remove(const fs::path& file) override {
    if (::remove(file.c_str()) != 0) {
      throw IoError("remove", file, errno);
    }
  }

  void make_folder(const fs::path& folder) override {
    if (::mkdir(folder.c_str(), kFolderMode) != 0) {
      throw IoError("make the folder", folder, errno);
    }
  }

  void sync_folder(const fs::path& folder) override {
    const Descriptor descriptor(
        uninterrupted([&] { return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }));
    if (descriptor.number() < 0) {
      throw SyncError("open the folder", folder, errno);
    }
    if (::fsync(descriptor.number()) != 0) {
      throw SyncError("flush the folder", folder, errno);
    }
  }
};

}  // namespace

// The system calls of a durable write of DIR/NAME, in this order:
//
//   openat(DIR/NAME.part, O_WRONLY|O_CREAT|O_EXCL|O_APPEND)   (after unlink, if a crash left one)
//   write(…) until all bytes are in
//   fsync(NAME.part)            the bytes are on the disk, under a name nobody reads
//   close
//   rename(NAME.part, NAME)     the name changes at once: a reader sees all of it or none
//   open(DIR), fsync(DIR)       the name is on the disk
//
// A power cut before the last step leaves NAME.part, or NAME whole; never a NAME that is half there.
void FileSystem::write_durably(const fs::path& file, ByteView bytes) {
  fs::path part = file;
  part += kPartSuffix;
  if (exists(part)) {
    remove(part);
  }
  try {
    {
      const std::unique_ptr<WritableFile> written = create(part);
      written->write(bytes);
      written->sync_all();
    }
    rename(part, file);
  } catch (const IoError&) {
    try {
      remove(part);
    } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
    }
    throw;
  }
  sync_folder(file.parent_path());
}

void remove_tree(FileSystem& files, const fs::path& folder) {
  for (const std::string& name : files.names_in(folder)) {
    if (files.is_folder(folder / name)) {
      remove_tree(files, folder / name);
    } else {
      files.remove(folder / name);
    }
  }
  files.remove(folder);
}

FileSystem& real_file_system() {
  static RealFileSystem system;
  return system;
}

}  // namespace kiroku::archive
