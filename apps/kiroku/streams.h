// Input and output of seal and unseal: a file or "-".
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "apps/kiroku/output_file.h"
#include "base/bytes.h"

namespace kiroku::apps {

/// Bytes from a file or, for "-", standard input. One thread.
class InputStream {
 public:
  explicit InputStream(const std::string& name);
  ~InputStream();
  InputStream(const InputStream&) = delete;
  InputStream& operator=(const InputStream&) = delete;
  /// Fills as much as there is; fewer bytes only at the end. Throws kiroku::IoError.
  std::size_t read(std::span<std::byte> into);
  /// The next bytes, at most `most`, without taking them.
  ByteView peek(std::size_t most);
  /// Whether it can be read by offset; then file() is where.
  [[nodiscard]] bool is_regular_file() const { return regular_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }  // 0 where unknown
  [[nodiscard]] const std::filesystem::path& file() const { return name_; }

 private:
  std::size_t read_some(std::span<std::byte> into);

  std::filesystem::path name_;
  int descriptor_;
  bool regular_ = false;
  std::uint64_t size_ = 0;
  Bytes ahead_;  // peeked, not yet taken
};

/// Bytes to a file that is wholly there or not at all, or to standard output. One thread.
class OutputStream {
 public:
  /// No name or "-": standard output. Without a name a terminal is refused if the bytes are `binary`.
  /// Throws kiroku::UsageError also where output and `input` are one file.
  OutputStream(const std::optional<std::string>& name, const InputStream& input, bool binary);
  void write(ByteView bytes);
  void commit(OutputFile::Durability durability);
  /// For who writes by offset instead of write(); -1 where that cannot be.
  [[nodiscard]] int descriptor() const { return file_ ? file_->descriptor() : -1; }
  [[nodiscard]] std::filesystem::path name() const { return file_ ? file_->name() : "standard output"; }
  [[nodiscard]] bool is_file() const { return file_ != nullptr; }

 private:
  std::unique_ptr<OutputFile> file_;
};

}  // namespace kiroku::apps
