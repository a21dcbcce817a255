#include "archive/storage/recording_lock.h"

#include <array>
#include <cerrno>
#include <span>
#include <string>
#include <string_view>
#include <unistd.h>
#include <utility>

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

std::unique_ptr<WritableFile> open_or_create(FileSystem& files, const fs::path& file) {
  if (!files.exists(file)) {
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

/// For people only: where it cannot be read nothing is said of it.
std::string holder_of(const FileReading& files, const fs::path& file) try {
  std::array<char, 32> text{};
  const std::size_t size = files.open_to_read(file).read_at(0, std::as_writable_bytes(std::span(text)));
  const std::string_view line(text.data(), size);
  const std::string number(line.substr(0, line.find('\n')));
  const bool plain = !number.empty() && number.find_first_not_of("0123456789") == std::string::npos;
  return plain ? " (process " + number + ")" : "";
} catch (const Error&) {
  return "";
}

}  // namespace

RecordingLock RecordingLock::take(FileSystem& files, const fs::path& archive) {
  const fs::path file = archive / ".recorder";
  std::unique_ptr<WritableFile> opened = open_or_create(files, file);
  if (!opened->try_lock()) {
    throw UsageError("another recorder" + holder_of(files, file) + " is at work in " + archive.string() +
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
