#include "archive/storage/space_reserve.h"

#include <cerrno>
#include <optional>
#include <utility>

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// Bytes the file holds; 0 if there is none. Throws where that cannot be told: a reserve that is there and
/// passes for none would be given up.
std::uint64_t held_by(const FileReading& files, const fs::path& file) {
  const std::optional<FileStatus> status = files.status(file);
  return status ? status->bytes : 0;
}

/// Two recordings may begin at once: whoever comes second finds the other's file.
std::unique_ptr<WritableFile> open_or_create(FileSystem& files, const fs::path& file) {
  if (files.exists(file)) {
    return files.append_to(file);
  }
  try {
    return files.create(file);
  } catch (const IoError& error) {
    if (error.error_number() != EEXIST) {
      throw;
    }
    return files.append_to(file);
  }
}

}  // namespace

SpaceReserve::SpaceReserve(FileSystem& files, fs::path file) : files_(&files), file_(std::move(file)) {}

// Blocks are allocated beyond the end first and the size follows: so the size never promises blocks that are
// not there, and tells every process how much is left.
void SpaceReserve::fill() {
  const std::lock_guard lock(mutex_);
  const std::uint64_t held = held_by(*files_, file_);
  if (held >= kBytes) {
    return;
  }
  const std::unique_ptr<WritableFile> file = open_or_create(*files_, file_);
  try {
    file->reserve(kBytes - held);
  } catch (const IoError&) {
    file->truncate(held);  // what was found before the disk was full would be lost to everybody
    throw;
  }
  file->truncate(kBytes);
}

bool SpaceReserve::release_step() {
  const std::lock_guard lock(mutex_);
  std::uint64_t held = 0;
  try {
    held = held_by(*files_, file_);
  } catch (const IoError&) {
    return false;  // the full disk is what whoever asked has to tell
  }
  if (held == 0) {
    return false;
  }
  files_->append_to(file_)->truncate(held > kStep ? held - kStep : 0);
  return true;
}

void SpaceReserve::write_durably(const fs::path& file, ByteView bytes) {
  support([&] { files_->write_durably(file, bytes); });
}

fs::path reserve_file(const fs::path& archive) { return archive / ".reserve"; }

}  // namespace kiroku::archive
