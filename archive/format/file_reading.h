// Every read of the archive goes through here: the one place where tests play a disk that cannot be read, or
// gives back less than was asked for. Thread-safe.
#pragma once

#include <cstdint>
#include <dirent.h>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <sys/stat.h>
#include <sys/types.h>
#include <utility>
#include <vector>

#include "base/utc_time.h"
#include "crypto/byte_source.h"

namespace kiroku::archive {

class ReadableFile;

/// What a name stands for.
struct FileStatus {
  enum class Kind { kRegular, kFolder, kLink, kSpecial };
  Kind kind = Kind::kRegular;
  std::uint64_t bytes = 0;
  UtcTime last_change;  // of the contents, by the wall clock
};

/// How files are read. The first four are the system's calls, each of which a test may let fail; the others
/// stand on them. `path` is what an error names.
class FileReading {
 public:
  virtual ~FileReading() = default;

  /// openat(2), read-only and O_CLOEXEC, with `flags`: a descriptor, or -1 and errno. EINTR is not told.
  virtual int open_at(int folder, const std::string& name, int flags,
                      const std::filesystem::path& path) const;
  /// One pread(2): how much came, which may be less than was asked for; 0 at the end; -1 and errno.
  virtual ssize_t read_at(int descriptor, std::uint64_t offset, std::span<std::byte> into,
                          const std::filesystem::path& path) const;
  /// fstatat(2) without following a link: 0, or -1 and errno.
  virtual int status_at(int folder, const std::string& name, struct stat& status,
                        const std::filesystem::path& path) const;
  /// readdir(3): null at the end, with errno 0, and where it failed, with errno.
  virtual const dirent* next_name(DIR* folder, const std::filesystem::path& path) const;

  /// What `path` stands for, a link for itself; nothing where nothing is there. Throws kiroku::IoError where
  /// that cannot be told.
  [[nodiscard]] std::optional<FileStatus> status(const std::filesystem::path& path) const;
  /// Whether anything is there, be it a link to nothing. Throws kiroku::IoError.
  [[nodiscard]] bool exists(const std::filesystem::path& path) const;
  /// Whether a folder is there, not a link to one. Throws kiroku::IoError.
  [[nodiscard]] bool is_folder(const std::filesystem::path& path) const;
  /// All names in a folder, sorted. Throws kiroku::IoError, also where it is not there.
  [[nodiscard]] std::vector<std::string> names_in(const std::filesystem::path& folder) const;
  /// A regular file, not reached over a link in its last place. Throws kiroku::IoError, kiroku::Error where
  /// it is no regular file. This object must outlive what it returns.
  [[nodiscard]] ReadableFile open_to_read(const std::filesystem::path& file) const;
};

/// The operating system's.
const FileReading& real_reading();

/// A regular file open for reading. Movable; read_at() is thread-safe.
class ReadableFile final : public crypto::ByteSource {
 public:
  /// Takes over the descriptor of a regular file. `reading` must outlive the object.
  ReadableFile(int descriptor, std::uint64_t size, std::filesystem::path path,
               const FileReading& reading = real_reading());
  ReadableFile(ReadableFile&& other) noexcept;
  ReadableFile& operator=(ReadableFile&&) = delete;
  ReadableFile(const ReadableFile&) = delete;
  ReadableFile& operator=(const ReadableFile&) = delete;
  ~ReadableFile() override;

  /// As it was when the file was opened.
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Fewer bytes only at the end of the file, which may have moved since. Throws kiroku::IoError.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override;
  /// All of `into`, for whoever concludes from what is not there. Throws kiroku::Error where the file ends
  /// before, kiroku::IoError.
  void read_wholly_at(std::uint64_t offset, std::span<std::byte> into) const;
  /// For whoever read `bytes` from the front until nothing more came, and concludes that nothing stands
  /// behind them. Throws kiroku::Error where the file is longer, and still is: a disk that fails may let a
  /// file end early. Throws kiroku::IoError.
  void require_read_to_end(std::uint64_t bytes) const;
  /// Where the first hole begins: 512 bytes or more that read as zeros and take no room on the disk. What is
  /// sealed has none, written or copied. Nothing where the file system tells of none. Throws kiroku::IoError.
  [[nodiscard]] std::optional<std::uint64_t> first_hole() const;
  /// Bytes in holes, as the file system tells. Throws kiroku::IoError.
  [[nodiscard]] std::uint64_t hole_bytes() const;
  /// What the file is under whatever name: device and inode. Nothing while it has one name alone.
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::uint64_t>> shared_inode() const;
  /// Tells the kernel that the file is read from front to end.
  void expect_sequential_reading() const;

 private:
  int descriptor_;
  std::uint64_t size_;
  std::filesystem::path path_;
  const FileReading* reading_;
};

}  // namespace kiroku::archive
