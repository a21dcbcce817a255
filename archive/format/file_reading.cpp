#include "archive/format/file_reading.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <fcntl.h>
#include <memory>
#include <unistd.h>
#include <utility>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

struct FolderCloser {
  void operator()(DIR* folder) const { ::closedir(folder); }
};

FileStatus::Kind kind_of(const struct stat& status) {
  if (S_ISREG(status.st_mode)) {
    return FileStatus::Kind::kRegular;
  }
  if (S_ISDIR(status.st_mode)) {
    return FileStatus::Kind::kFolder;
  }
  return S_ISLNK(status.st_mode) ? FileStatus::Kind::kLink : FileStatus::Kind::kSpecial;
}

[[noreturn]] void refuse_short(const fs::path& file, std::uint64_t wanted, std::uint64_t came) {
  throw Error("cannot read " + file.string() + ": of " + std::to_string(wanted) + " bytes " +
              std::to_string(came) + " came; check the disk");
}

}  // namespace

int FileReading::open_at(int folder, const std::string& name, int flags, const fs::path& /*path*/) const {
  int opened = -1;
  do {
    opened = ::openat(folder, name.c_str(), flags | O_RDONLY | O_CLOEXEC);
  } while (opened < 0 && errno == EINTR);
  return opened;
}

ssize_t FileReading::read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                             const fs::path& /*path*/) const {
  return ::pread(descriptor, into.data(), into.size(), static_cast<off_t>(offset));
}

int FileReading::status_at(int folder, const std::string& name, struct stat& status,
                           const fs::path& /*path*/) const {
  return ::fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW);
}

const dirent* FileReading::next_name(DIR* folder, const fs::path& /*path*/) const {
  errno = 0;  // what tells an error from the end
  return ::readdir(folder);
}

std::optional<FileStatus> FileReading::status(const fs::path& path) const {
  struct stat status {};
  if (status_at(AT_FDCWD, path.native(), status, path) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) {
      return std::nullopt;
    }
    throw IoError("examine", path, errno);
  }
  return FileStatus{kind_of(status), static_cast<std::uint64_t>(status.st_size),
                    UtcTime(std::chrono::seconds(status.st_mtim.tv_sec) +
                            std::chrono::microseconds(status.st_mtim.tv_nsec / 1'000))};
}

bool FileReading::exists(const fs::path& path) const { return status(path).has_value(); }

bool FileReading::is_folder(const fs::path& path) const {
  const std::optional<FileStatus> found = status(path);
  return found && found->kind == FileStatus::Kind::kFolder;
}

std::vector<std::string> FileReading::names_in(const fs::path& folder) const {
  Descriptor opened(open_at(AT_FDCWD, folder.native(), O_DIRECTORY, folder));
  const std::unique_ptr<DIR, FolderCloser> handle(opened ? ::fdopendir(opened.number()) : nullptr);
  if (!handle) {
    throw IoError("list folder", folder, errno);
  }
  (void)opened.release();  // the handle closes it
  std::vector<std::string> names;
  while (const dirent* entry = next_name(handle.get(), folder)) {
    if (const std::string name = entry->d_name; name != "." && name != "..") {
      names.push_back(name);
    }
  }
  if (errno != 0) {
    throw IoError("list folder", folder, errno);
  }
  std::sort(names.begin(), names.end());
  return names;
}

ReadableFile FileReading::open_to_read(const fs::path& file) const {
  Descriptor opened(open_at(AT_FDCWD, file.native(), O_NOFOLLOW | O_NONBLOCK, file));
  if (!opened) {
    throw IoError("read", file, errno);
  }
  struct stat status {};
  if (::fstat(opened.number(), &status) != 0) {
    throw IoError("examine", file, errno);
  }
  if (!S_ISREG(status.st_mode)) {
    throw Error("cannot read " + file.string() + ": it is no regular file");
  }
  return {opened.release(), static_cast<std::uint64_t>(status.st_size), file, *this};
}

const FileReading& real_reading() {
  static const FileReading reading;
  return reading;
}

ReadableFile::ReadableFile(int descriptor, std::uint64_t size, fs::path path, const FileReading& reading)
    : descriptor_(descriptor), size_(size), path_(std::move(path)), reading_(&reading) {}

ReadableFile::ReadableFile(ReadableFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      path_(std::move(other.path_)),
      reading_(other.reading_) {}

ReadableFile::~ReadableFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

std::size_t ReadableFile::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t got = reading_->read_at(descriptor_, offset + done, into.subspan(done), path_);
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

void ReadableFile::read_wholly_at(std::uint64_t offset, std::span<std::byte> into) const {
  if (const std::size_t came = read_at(offset, into); came != into.size()) {
    refuse_short(path_, into.size(), came);
  }
}

void ReadableFile::require_read_to_end(std::uint64_t bytes) const {
  if (bytes >= size_) {
    return;
  }
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) {
    throw IoError("examine", path_, errno);
  }
  if (const auto now = static_cast<std::uint64_t>(status.st_size); now > bytes) {
    refuse_short(path_, now, bytes);
  }
}

std::optional<std::uint64_t> ReadableFile::first_hole() const {
  constexpr std::size_t kLookedAt = 4096;
  constexpr std::size_t kSector = 512;
  const off_t at = ::lseek(descriptor_, 0, SEEK_HOLE);
  if (at < 0) {
    if (errno == ENXIO || errno == EINVAL) {
      return std::nullopt;  // an empty file, or a file system that cannot tell
    }
    throw IoError("look for holes in", path_, errno);
  }
  if (static_cast<std::uint64_t>(at) + kSector > size_) {
    return std::nullopt;  // what is told of is the end
  }
  // File systems have told of holes where there were none.
  std::array<std::byte, kLookedAt> there{};
  const std::size_t got = read_at(static_cast<std::uint64_t>(at), there);
  const bool zeros = std::all_of(there.begin(), there.begin() + static_cast<std::ptrdiff_t>(got),
                                 [](std::byte each) { return each == std::byte{0}; });
  return got >= kSector && zeros ? std::optional(static_cast<std::uint64_t>(at)) : std::nullopt;
}

std::uint64_t ReadableFile::hole_bytes() const {
  std::uint64_t bytes = 0;
  const off_t end = static_cast<off_t>(size_);
  for (off_t at = 0; at < end;) {
    const off_t hole = ::lseek(descriptor_, at, SEEK_HOLE);
    if (hole < 0 && errno != ENXIO && errno != EINVAL) {
      throw IoError("look for holes in", path_, errno);
    }
    if (hole < 0 || hole >= end) {
      break;
    }
    const off_t data = ::lseek(descriptor_, hole, SEEK_DATA);
    if (data < 0 && errno != ENXIO) {
      throw IoError("look for holes in", path_, errno);
    }
    at = data < 0 ? end : std::min(data, end);
    bytes += static_cast<std::uint64_t>(at - hole);
  }
  return bytes;
}

std::optional<std::pair<std::uint64_t, std::uint64_t>> ReadableFile::shared_inode() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) {
    throw IoError("examine", path_, errno);
  }
  return status.st_nlink > 1
             ? std::optional(std::pair<std::uint64_t, std::uint64_t>(status.st_dev, status.st_ino))
             : std::nullopt;
}

void ReadableFile::expect_sequential_reading() const {
  ::posix_fadvise(descriptor_, 0, 0, POSIX_FADV_SEQUENTIAL);  // a hint: failure changes nothing
}

}  // namespace kiroku::archive
