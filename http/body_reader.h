// The body of an answer in units, as a client takes them. One thread at a time.
#pragma once

#include <cstdint>
#include <optional>

#include "http/message.h"

namespace kiroku::http {

class BodyReader {
 public:
  /// `body` must outlive it.
  explicit BodyReader(const Body& body) : body_(body) {}

  /// In bytes; nothing for one whose size is not known before.
  [[nodiscard]] std::optional<std::uint64_t> size() const;
  /// Whether next() computes or reads files: then it is called where that may block.
  [[nodiscard]] bool may_block() const;
  /// What comes next, at most 256 KiB of what has a size, valid until the next call; empty at the end. Throws
  /// what the body throws, kiroku::Error for a file that became shorter.
  ByteView next();

 private:
  ByteView read_file(const FileBody& file, std::size_t count);

  const Body& body_;
  std::uint64_t done_ = 0;
  Bytes buffer_;
};

}  // namespace kiroku::http
