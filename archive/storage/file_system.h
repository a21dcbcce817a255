// Every write of the archive goes through here, and what whoever writes reads: the one place where faults are
// injected in tests, and where durability is spelt out. The real one is thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "archive/format/file_reading.h"
#include "base/bytes.h"
#include "base/error.h"

namespace kiroku::archive {

/// A flush to the disk failed. The kernel may have dropped the pages and would report success the next time,
/// so it is never retried: whoever owns the file refuses everything from then on, or opens it anew and goes
/// on behind what is known to be flushed.
class SyncError : public IoError {
 public:
  using IoError::IoError;
};

/// A file open for appending. write(), reserve(), write_behind() and truncate() by one thread; sync() from
/// any. Every function throws kiroku::IoError naming the file.
class WritableFile {
 public:
  virtual ~WritableFile() = default;
  /// All bytes or an IoError; some of them may stand in the file then.
  virtual void write(ByteView bytes) = 0;
  /// fdatasync: the bytes and the size. Throws SyncError.
  virtual void sync() = 0;
  /// fsync: times and permissions too, before a file gets its final name. Throws SyncError.
  virtual void sync_all() = 0;
  /// Allocates blocks for `bytes` more than there are without changing the size (fallocate KEEP_SIZE). Does
  /// nothing where the file system cannot; throws where the disk is full.
  virtual void reserve(std::uint64_t bytes) = 0;
  /// To be called now and then while much is written: base/write_behind.h.
  virtual void write_behind() = 0;
  /// Cuts or extends. Blocks allocated beyond `size` are given back.
  virtual void truncate(std::uint64_t size) = 0;
  /// Advisory lock of the open file (flock), against other processes and other openings in this one. True if
  /// it is ours now; false if another has it.
  virtual bool try_lock() = 0;
  /// The same, waiting so long at most: whoever may read a file can lock it.
  virtual bool lock(std::chrono::milliseconds patience) = 0;
  virtual void unlock() noexcept = 0;
};

class FileSystem : public FileReading {
 public:
  virtual std::unique_ptr<WritableFile> create(const std::filesystem::path& file) = 0;     // must not exist
  virtual std::unique_ptr<WritableFile> append_to(const std::filesystem::path& file) = 0;  // must exist
  virtual void rename(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  /// A file or an empty folder.
  virtual void remove(const std::filesystem::path& file) = 0;
  virtual void make_folder(const std::filesystem::path& folder) = 0;  // must not exist, its parent must
  /// fsync of the folder: names in it are durable. Throws SyncError.
  virtual void sync_folder(const std::filesystem::path& folder) = 0;
  /// A small file that is wholly there or not at all; one that stands there already is replaced. Nothing is
  /// left behind after an IoError.
  void write_durably(const std::filesystem::path& file, ByteView bytes);
};

/// Removes a folder and all below it; symbolic links are removed, never followed. Throws kiroku::IoError.
void remove_tree(FileSystem& files, const std::filesystem::path& folder);

/// The operating system's.
FileSystem& real_file_system();

}  // namespace kiroku::archive
