// Who may record into an archive: one process at a time. What lies unfinished in an archive whose lock is
// free was left by a recorder that died. Not thread-safe.
#pragma once

#include <filesystem>
#include <memory>

#include "archive/storage/file_system.h"

namespace kiroku::archive {

class RecordingLock {
 public:
  /// Takes `<archive>/.recorder` (flock, so the kernel gives it back whatever becomes of the process); the
  /// file is made if need be and holds the process's number for people to read. Throws UsageError naming that
  /// process if another one records or recovers, kiroku::IoError.
  static RecordingLock take(FileSystem& files, const std::filesystem::path& archive);

 private:
  explicit RecordingLock(std::unique_ptr<WritableFile> file) : file_(std::move(file)) {}
  std::unique_ptr<WritableFile> file_;
};

}  // namespace kiroku::archive
