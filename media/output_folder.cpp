#include "media/output_folder.h"

#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::media {
namespace {

namespace fs = std::filesystem;

/// Names in it survive a power cut.
void sync_folder(const fs::path& folder) {
  const Descriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!opened || ::fsync(opened.number()) != 0) throw IoError("make durable", folder, errno);
}

fs::path without_slash(fs::path folder) { return folder.has_filename() ? folder : folder.parent_path(); }

}  // namespace

OutputFolder::OutputFolder(fs::path folder, bool overwrite, WhyKept why_kept)
    : folder_(without_slash(std::move(folder))),
      part_(folder_),
      overwrite_(overwrite),
      why_kept_(std::move(why_kept)) {
  part_ += ".part";
  require_replaceable();
  constexpr mode_t kOwnerOnly = 0700;
  if (::mkdir(part_.c_str(), kOwnerOnly) != 0) {
    if (errno != EEXIST) throw IoError("create", part_, errno);
    throw UsageError(part_.string() +
                     " is there already: another program writes it, or one was killed; remove it if nothing "
                     "does");
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(part_, ignored);
}

void OutputFolder::require_replaceable() const {
  const fs::file_status status = fs::symlink_status(folder_);
  if (!fs::exists(status)) return;
  if (!overwrite_) {
    throw UsageError(folder_.string() +
                     " is already there; choose another name, or overwrite it with --force");
  }
  const std::string why = fs::is_directory(status) ? why_kept_(folder_) : "it is no folder";
  if (!why.empty()) {
    throw UsageError(folder_.string() + " is not replaced, since " + why + "; choose another name");
  }
}

void OutputFolder::commit() {
  require_replaceable();
  sync_folder(part_);
  const fs::path parent = folder_.has_parent_path() ? folder_.parent_path() : fs::path(".");
  const bool replaces = fs::exists(fs::symlink_status(folder_));
  const unsigned how = replaces ? RENAME_EXCHANGE : RENAME_NOREPLACE;
  if (::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, folder_.c_str(), how) != 0) {
    if (errno == EINVAL) {
      throw Error("this file system cannot put a whole folder in place of " + folder_.string() +
                  ": give a folder on another disk, or export the streams one by one (--stream)");
    }
    throw IoError("rename to its final name", part_, errno);
  }
  committed_ = true;
  sync_folder(parent);
  std::error_code error;
  if (replaces) fs::remove_all(part_, error);
  if (error) throw IoError("remove what was replaced,", part_, error.value());
}

}  // namespace kiroku::media
