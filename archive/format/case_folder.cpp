#include "archive/format/case_folder.h"

#include <algorithm>
#include <array>
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

/// A folder that is open, and what errors and tests call it.
struct OpenFolder {
  const FileReading& reading;
  int descriptor;
  std::filesystem::path path;

  [[nodiscard]] int open_below(const std::string& name, int flags) const {
    return reading.open_at(descriptor, name, flags | O_NOFOLLOW | O_NONBLOCK, path / name);
  }
  [[nodiscard]] int status_of(const std::string& name, struct stat& status) const {
    return reading.status_at(descriptor, name, status, path / name);
  }
};

/// What is the matter with a name that could not be opened.
FileOpening failed_opening(const OpenFolder& folder, const std::string& name, int error) {
  struct stat status {};
  const bool seen = folder.status_of(name, status) == 0;
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
int list_into(const FileReading& reading, const std::filesystem::path& path, Descriptor opened,
              const std::string& prefix, int depth, std::vector<ListedFile>& all) {
  const FolderHandle handle(::fdopendir(opened.number()));
  if (!handle) {
    return errno;
  }
  (void)opened.release();  // the handle closes it
  const OpenFolder folder{reading, ::dirfd(handle.get()), path};
  for (;;) {
    const dirent* entry = reading.next_name(handle.get(), path);
    if (entry == nullptr) {
      return errno;
    }
    const std::string name = entry->d_name;
    if (name == "." || name == "..") {
      continue;
    }
    struct stat status {};
    if (folder.status_of(name, status) != 0) {
      if (errno != ENOENT) {  // else it is gone since
        all.push_back({prefix + name, ListedFile::Kind::kUnreadable, 0});
      }
      continue;
    }
    ListedFile file{prefix + name, kind_of(status), static_cast<std::uint64_t>(status.st_size)};
    if (file.kind == ListedFile::Kind::kFolder && depth < kMaximumFolderDepth) {
      Descriptor below(folder.open_below(name, O_DIRECTORY));
      if (!below || list_into(reading, path / name, std::move(below), file.path + "/", depth + 1, all) != 0) {
        file.kind = ListedFile::Kind::kUnreadable;
      }
    }
    all.push_back(std::move(file));
  }
}

}  // namespace

CaseFolder CaseFolder::open(const std::filesystem::path& folder, const FileReading& reading) {
  const int descriptor = reading.open_at(AT_FDCWD, folder.native(), O_DIRECTORY, folder);
  if (descriptor < 0) {
    if (errno == ENOENT || errno == ENOTDIR) {
      throw UsageError("there is no folder " + folder.string() + "; give the folder of a case");
    }
    throw IoError("open folder", folder, errno);
  }
  return {descriptor, folder, reading};
}

CaseFolder::CaseFolder(CaseFolder&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      path_(std::move(other.path_)),
      reading_(other.reading_) {}

CaseFolder::~CaseFolder() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

FileOpening CaseFolder::open_file(std::string_view relative) const {
  Descriptor inner(::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0));
  OpenFolder folder{*reading_, inner.number(), path_};
  std::string_view rest = relative;
  for (;;) {
    const std::size_t slash = rest.find('/');
    const std::string name(rest.substr(0, slash));
    if (name.empty() || name == "." || name == ".." || name.find('\0') != std::string::npos) {
      return {std::nullopt, FileProblem::kMissing, "is not a name of the case format"};
    }
    if (slash == std::string_view::npos) {
      Descriptor opened(folder.open_below(name, 0));
      if (!opened) {
        return failed_opening(folder, name, errno);
      }
      struct stat status {};
      if (::fstat(opened.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
        return {std::nullopt, FileProblem::kNotRegular,
                S_ISDIR(status.st_mode) ? "is a folder" : "is a special file"};
      }
      return {ReadableFile(opened.release(), static_cast<std::uint64_t>(status.st_size), path_ / relative,
                           *reading_),
              {},
              {}};
    }
    Descriptor below(folder.open_below(name, O_DIRECTORY));
    if (!below) {
      return failed_opening(folder, name, errno);
    }
    inner = std::move(below);
    folder.descriptor = inner.number();
    folder.path /= name;
    rest.remove_prefix(slash + 1);
  }
}

std::vector<ListedFile> CaseFolder::list() const {
  std::vector<ListedFile> all;
  Descriptor again(OpenFolder{*reading_, descriptor_, path_}.open_below(".", O_DIRECTORY));
  if (!again) {
    throw IoError("list folder", path_, errno);
  }
  if (const int error = list_into(*reading_, path_, std::move(again), "", 1, all); error != 0) {
    throw IoError("list folder", path_, error);
  }
  std::sort(all.begin(), all.end(), [](const ListedFile& a, const ListedFile& b) { return a.path < b.path; });
  return all;
}

std::optional<std::string> CaseFolder::read_if_there(std::string_view relative, std::size_t limit) const {
  const FileOpening opening = open_file(relative);
  if (!opening.file && opening.problem == FileProblem::kUnreadable) {
    throw Error((path_ / relative).string() + " " + opening.explanation + "; check the disk");
  }
  std::optional<std::string> text = opening.file ? read_small(*opening.file, limit) : std::nullopt;
  if (text) {
    opening.file->require_read_to_end(text->size());
  }
  return text;
}

std::optional<std::string> read_small(const ReadableFile& file, std::size_t limit) {
  // A block or two cost no more than opening the file.
  constexpr std::size_t kTooSmallToCost = 4096;
  if (file.size() > limit || (file.size() > kTooSmallToCost && file.first_hole())) {
    return std::nullopt;
  }
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  text.resize(file.read_at(0, std::as_writable_bytes(std::span(text.data(), text.size()))));
  return text;
}

}  // namespace kiroku::archive
