#include "media/output_file.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/error.h"

namespace kiroku::media {
namespace {

void require_absent(const std::filesystem::path& file) {
  if (std::filesystem::exists(std::filesystem::symlink_status(file))) {
    throw UsageError("the file " + file.string() +
                     " is already there; choose another name, or overwrite it with --force");
  }
}

}  // namespace

OutputFile::OutputFile(std::filesystem::path file, bool overwrite)
    : file_(std::move(file)), part_(file_), overwrite_(overwrite) {
  part_ += ".part";
  if (std::filesystem::is_directory(file_)) {
    throw UsageError("the output " + file_.string() + " is a folder; give the name of a file in it");
  }
  if (!overwrite_) {
    require_absent(file_);
  }
  constexpr mode_t kOwnerOnly = 0600;
  descriptor_ = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, kOwnerOnly);
  if (descriptor_ < 0) {
    throw IoError("create", part_, errno);
  }
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
  if (!committed_) {
    ::unlink(part_.c_str());
  }
}

void OutputFile::write(ByteView bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(position_));
    if (written < 0) {
      if (errno == EINTR) {
        continue;
      }
      throw IoError("write", part_, errno);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    position_ += static_cast<std::uint64_t>(written);
    size_ = std::max(size_, position_);
  }
}

void OutputFile::commit() {
  if (::fsync(descriptor_) != 0) {
    throw IoError("write", part_, errno);
  }
  if (!overwrite_) {
    require_absent(file_);
  }
  std::error_code error;
  std::filesystem::rename(part_, file_, error);
  if (error) {
    throw IoError("rename to its final name", part_, error.value());
  }
  committed_ = true;
}

}  // namespace kiroku::media
