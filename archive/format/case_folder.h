// Reading a case folder that somebody may have prepared: nothing outside it is ever opened. Symbolic links
// are not followed at any level (openat with O_NOFOLLOW, component by component), special files are not
// opened for reading (a FIFO would block for ever). Immutable after open(); thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "archive/format/file_reading.h"
#include "base/bytes.h"
#include "crypto/age_file.h"

namespace kiroku::archive {

enum class FileProblem { kMissing, kNotRegular, kUnreadable };
struct FileOpening {
  std::optional<ReadableFile> file;
  FileProblem problem = FileProblem::kMissing;  // where there is no file
  std::string explanation;                      // "is a symbolic link", "cannot be read: Permission denied"
};

/// One name in the folder.
struct ListedFile {
  enum class Kind { kRegular, kFolder, kLink, kSpecial, kUnreadable };  // kUnreadable: what it is or holds
  std::string path;                                                     // relative, with '/'
  Kind kind = Kind::kRegular;
  std::uint64_t bytes = 0;
};

class CaseFolder {
 public:
  /// `folder` itself may be reached over links: that is the caller's choice. Throws kiroku::UsageError if
  /// there is no such folder, kiroku::IoError if it cannot be opened. `reading` must outlive the object and
  /// what it opens.
  static CaseFolder open(const std::filesystem::path& folder, const FileReading& reading = real_reading());
  CaseFolder(CaseFolder&& other) noexcept;
  CaseFolder& operator=(CaseFolder&&) = delete;
  CaseFolder(const CaseFolder&) = delete;
  CaseFolder& operator=(const CaseFolder&) = delete;
  ~CaseFolder();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// `relative` must be as format 1 names files: no empty, "." or ".." component (kMissing otherwise).
  [[nodiscard]] FileOpening open_file(std::string_view relative) const;
  /// The file's bytes; nothing where it is not there, no regular file, longer than `limit`, or with a hole
  /// (read_small). For whoever
  /// takes what is not there as never written: throws kiroku::Error where it is there and cannot be read, or
  /// not to its end, kiroku::IoError.
  [[nodiscard]] std::optional<std::string> read_if_there(std::string_view relative, std::size_t limit) const;
  /// Everything in the folder, sorted by path, down to three levels (segments/<stream>/<file>); a folder
  /// below that is listed and not entered.
  [[nodiscard]] std::vector<ListedFile> list() const;

 private:
  CaseFolder(int descriptor, std::filesystem::path path, const FileReading& reading)
      : descriptor_(descriptor), path_(std::move(path)), reading_(&reading) {}

  int descriptor_;
  std::filesystem::path path_;
  const FileReading* reading_;
};

/// The file's bytes if there are at most `limit`; nothing if there are more, or if it has a hole, which costs
/// whoever makes it nothing: nothing small is written with one. Throws kiroku::IoError.
std::optional<std::string> read_small(const ReadableFile& file, std::size_t limit);

}  // namespace kiroku::archive
