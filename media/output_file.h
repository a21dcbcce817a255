// A file that appears under its name only when it is whole. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <filesystem>

#include "base/bytes.h"

namespace kiroku::media {

/// Bytes that are written anywhere.
class OutputBytes {
 public:
  virtual ~OutputBytes() = default;
  /// Appends at the position.
  virtual void write(ByteView bytes) = 0;
  virtual void seek(std::uint64_t position) = 0;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
};

/// Writes `<name>.part` beside the file, readable by its owner alone, since what is exported is a patient's.
class OutputFile : public OutputBytes {
 public:
  /// Throws kiroku::UsageError if the file is there and `overwrite` is false, kiroku::IoError if it cannot be
  /// written. A `.part` left behind by an earlier run is written over.
  OutputFile(std::filesystem::path file, bool overwrite);
  /// What was not committed is removed.
  ~OutputFile() override;
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Appends at the position; throws kiroku::IoError (disk full).
  void write(ByteView bytes) override;
  void seek(std::uint64_t position) override { position_ = position; }
  [[nodiscard]] std::uint64_t position() const { return position_; }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  /// fsync and rename; nothing may be written after. Throws kiroku::IoError, kiroku::UsageError if the file
  /// has come to be there meanwhile and may not be overwritten.
  void commit();

 private:
  std::filesystem::path file_, part_;
  bool overwrite_;
  int descriptor_ = -1;
  bool committed_ = false;
  std::uint64_t position_ = 0, size_ = 0;
};

}  // namespace kiroku::media
