#include "archive/storage/recording_lock.h"

#include <cerrno>
#include <fstream>
#include <string>
#include <unistd.h>
#include <utility>

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

std::unique_ptr<WritableFile> open_or_create(FileSystem& files, const fs::path& file) {
  if (!fs::exists(file)) {
    try {
      return files.create(file);
    } catch (const IoError& error) {
      if (error.error_number() != EEXIST) {
        throw;
      }
    }
  }
  return files.append_to(file);
}

std::string holder_of(const fs::path& file) {
  std::ifstream input(file);
  std::string number;
  std::getline(input, number);
  const bool plain = !number.empty() && number.find_first_not_of("0123456789") == std::string::npos;
  return plain ? " (process " + number + ")" : "";
}

}  // namespace

RecordingLock RecordingLock::take(FileSystem& files, const fs::path& archive) {
  const fs::path file = archive / ".recorder";
  std::unique_ptr<WritableFile> opened = open_or_create(files, file);
  if (!opened->try_lock()) {
    throw UsageError("another recorder" + holder_of(file) + " is at work in " + archive.string() +
                     ": wait until it has ended, or end it first");
  }
  try {
    opened->truncate(0);
    opened->write(bytes_of(std::to_string(::getpid()) + "\n"));
  } catch (const IoError& error) {
    if (!error.disk_full()) {
      throw;
    }
    // The number is for people only: a full disk keeps nobody from recovering.
  }
  return RecordingLock(std::move(opened));
}

}  // namespace kiroku::archive
