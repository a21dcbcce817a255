// Every write of the archive goes through here: the one place where faults are injected in tests, and where
// durability is spelt out. The real one is thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::archive {

/// A file open for appending. write() by one thread; sync() from any.
class WritableFile {
 public:
  virtual ~WritableFile() = default;
  /// All bytes or an IoError.
  virtual void write(ByteView bytes) = 0;
  /// fdatasync. An error here is final: the kernel may have dropped the pages, so it is never retried.
  virtual void sync() = 0;
  /// Allocates blocks ahead without changing the size (fallocate KEEP_SIZE); best effort where the file
  /// system cannot.
  virtual void reserve(std::uint64_t bytes) = 0;
  /// Asks the kernel to begin writing back without waiting.
  virtual void start_writeback() = 0;
  virtual void truncate(std::uint64_t size) = 0;
};

class FileSystem {
 public:
  virtual ~FileSystem() = default;
  virtual std::unique_ptr<WritableFile> create(const std::filesystem::path& file) = 0;  // must not exist
  virtual std::unique_ptr<WritableFile> append_to(const std::filesystem::path& file) = 0;
  virtual void rename(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  virtual void remove(const std::filesystem::path& file) = 0;
  virtual void make_folder(const std::filesystem::path& folder) = 0;
  virtual void sync_folder(const std::filesystem::path& folder) = 0;
  /// A small file that is wholly there or not at all: NAME.part, fsync, rename, fsync of the folder.
  void write_durably(const std::filesystem::path& file, ByteView bytes);
};

/// The operating system's.
FileSystem& real_file_system();

}  // namespace kiroku::archive
