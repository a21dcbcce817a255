#include "archive/format/case_folder.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <dirent.h>
#include <fcntl.h>
#include <memory>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "archive/format/limits.h"
#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

struct FolderCloser {
  void operator()(DIR* folder) const { ::closedir(folder); }
};
using FolderHandle = std::unique_ptr<DIR, FolderCloser>;

int open_below(int folder, const std::string& name, int flags) {
  int opened = -1;
  do {
    opened = ::openat(folder, name.c_str(), flags | O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  } while (opened < 0 && errno == EINTR);
  return opened;
}

/// What is the matter with a name that could not be opened.
FileOpening failed_opening(int folder, const std::string& name, int error) {
  struct stat status {};
  const bool seen = ::fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0;
  if (!seen && (errno == ENOENT || errno == ENOTDIR)) {
    return {std::nullopt, FileProblem::kMissing, "is not there"};
  }
  if (seen && S_ISLNK(status.st_mode)) {
    return {std::nullopt, FileProblem::kNotRegular, "is a symbolic link"};
  }
  if (seen && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode)) {
    return {std::nullopt, FileProblem::kNotRegular, "is a special file"};
  }
  if (seen && error == ENOTDIR) {
    return {std::nullopt, FileProblem::kMissing, "is not there"};
  }
  return {std::nullopt, FileProblem::kUnreadable, std::string("cannot be read: ") + std::strerror(error)};
}

ListedFile::Kind kind_of(const struct stat& status) {
  if (S_ISREG(status.st_mode)) {
    return ListedFile::Kind::kRegular;
  }
  if (S_ISDIR(status.st_mode)) {
    return ListedFile::Kind::kFolder;
  }
  return S_ISLNK(status.st_mode) ? ListedFile::Kind::kLink : ListedFile::Kind::kSpecial;
}

/// 0, or the error for which the folder could not be listed to its end.
int list_into(Descriptor folder, const std::string& prefix, int depth, std::vector<ListedFile>& all) {
  const FolderHandle handle(::fdopendir(folder.number()));
  if (!handle) {
    return errno;
  }
  (void)folder.release();  // the handle closes it
  for (;;) {
    errno = 0;  // what tells an error from the end
    const dirent* entry = ::readdir(handle.get());
    if (entry == nullptr) {
      return errno;
    }
    const std::string name = entry->d_name;
    if (name == "." || name == "..") {
      continue;
    }
    struct stat status {};
    if (::fstatat(::dirfd(handle.get()), name.c_str(), &status, AT_SYMLINK_NOFOLLOW) != 0) {
      if (errno != ENOENT) {  // else it is gone since
        all.push_back({prefix + name, ListedFile::Kind::kUnreadable, 0});
      }
      continue;
    }
    ListedFile file{prefix + name, kind_of(status), static_cast<std::uint64_t>(status.st_size)};
    if (file.kind == ListedFile::Kind::kFolder && depth < kMaximumFolderDepth) {
      Descriptor below(open_below(::dirfd(handle.get()), name, O_DIRECTORY));
      if (!below || list_into(std::move(below), file.path + "/", depth + 1, all) != 0) {
        file.kind = ListedFile::Kind::kUnreadable;
      }
    }
    all.push_back(std::move(file));
  }
}

}  // namespace

ReadableFile::ReadableFile(int descriptor, std::uint64_t size, std::filesystem::path path)
    : descriptor_(descriptor), size_(size), path_(std::move(path)) {}

ReadableFile::ReadableFile(ReadableFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_), path_(std::move(other.path_)) {}

ReadableFile::~ReadableFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

std::size_t ReadableFile::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t got =
        ::pread(descriptor_, into.data() + done, into.size() - done, static_cast<off_t>(offset + done));
    if (got < 0) {
      if (errno == EINTR) {
        continue;
      }
      throw IoError("read", path_, errno);
    }
    if (got == 0) {
      break;
    }
    done += static_cast<std::size_t>(got);
  }
  return done;
}

void ReadableFile::expect_sequential_reading() const {
  ::posix_fadvise(descriptor_, 0, 0, POSIX_FADV_SEQUENTIAL);  // a hint: failure changes nothing
}

CaseFolder CaseFolder::open(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) {
    if (errno == ENOENT || errno == ENOTDIR) {
      throw UsageError("there is no folder " + folder.string() + "; give the folder of a case");
    }
    throw IoError("open folder", folder, errno);
  }
  return {descriptor, folder};
}

CaseFolder::CaseFolder(CaseFolder&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)) {}

CaseFolder::~CaseFolder() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

FileOpening CaseFolder::open_file(std::string_view relative) const {
  Descriptor folder(::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0));
  std::string_view rest = relative;
  for (;;) {
    const std::size_t slash = rest.find('/');
    const std::string name(rest.substr(0, slash));
    if (name.empty() || name == "." || name == ".." || name.find('\0') != std::string::npos) {
      return {std::nullopt, FileProblem::kMissing, "is not a name of the case format"};
    }
    if (slash == std::string_view::npos) {
      const Descriptor opened(open_below(folder.number(), name, 0));
      if (!opened) {
        return failed_opening(folder.number(), name, errno);
      }
      struct stat status {};
      if (::fstat(opened.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
        return {std::nullopt, FileProblem::kNotRegular,
                S_ISDIR(status.st_mode) ? "is a folder" : "is a special file"};
      }
      return {ReadableFile(::fcntl(opened.number(), F_DUPFD_CLOEXEC, 0),
                           static_cast<std::uint64_t>(status.st_size), path_ / relative),
              {},
              {}};
    }
    Descriptor below(open_below(folder.number(), name, O_DIRECTORY));
    if (!below) {
      return failed_opening(folder.number(), name, errno);
    }
    folder = std::move(below);
    rest.remove_prefix(slash + 1);
  }
}

std::vector<ListedFile> CaseFolder::list() const {
  std::vector<ListedFile> all;
  Descriptor again(open_below(descriptor_, ".", O_DIRECTORY));
  if (!again) {
    throw IoError("list folder", path_, errno);
  }
  if (const int error = list_into(std::move(again), "", 1, all); error != 0) {
    throw IoError("list folder", path_, error);
  }
  std::sort(all.begin(), all.end(), [](const ListedFile& a, const ListedFile& b) { return a.path < b.path; });
  return all;
}

std::optional<std::string> read_small(const ReadableFile& file, std::size_t limit) {
  if (file.size() > limit) {
    return std::nullopt;
  }
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  text.resize(file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size()))));
  return text;
}

}  // namespace kiroku::archive
