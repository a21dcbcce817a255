// The lines of a ledger, one after the other, in constant memory whatever the file holds. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/byte_source.h"

namespace kiroku::archive {

/// One line without its LF.
struct LedgerLine {
  std::string_view text;     // valid until the next call; only the beginning where it is too long
  std::uint64_t offset = 0;  // of its first byte in the file
  std::uint64_t bytes = 0;   // of the whole line, without LF
  bool too_long = false;     // longer than the format's kMaximumLineBytes
  /// The file ends before an LF: the last line of a write that did not finish. So does one with which more
  /// than kMostBytesOfLine stand in lines that are none, which counts as too long: no further line is read.
  bool torn = false;
};

/// Why a ledger of which too many lines are no entries is not read beyond line `number`.
std::string unreadable_text(std::uint64_t number);

/// The first line of a file without its LF; nothing where it is not whole, is longer than a line may be, or
/// holds a zero byte, which no line of the format does. Of a file that takes no room on a disk 4 KiB are
/// read. Throws what the source throws.
std::optional<std::string> first_whole_line(const crypto::ByteSource& file);

class LineReader {
 public:
  /// `file` must outlive the reader.
  explicit LineReader(const crypto::ByteSource& file) : file_(&file) {}
  /// The next line; false at the end. Throws what the source throws.
  bool next(LedgerLine& line);

 private:
  bool fill();

  const crypto::ByteSource* file_;
  std::uint64_t read_ = 0;  // bytes taken from the file
  std::string buffer_;
  std::size_t at_ = 0;  // in buffer_
  std::string line_;
  std::uint64_t wasted_ = 0;  // bytes of lines that are too long or hold a zero byte
  bool gave_up_ = false;
};

}  // namespace kiroku::archive
