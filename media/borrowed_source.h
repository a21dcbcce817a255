// A source of bytes that is somebody else's, for those who take sources over.
#pragma once

#include "crypto/byte_source.h"

namespace kiroku::media {

/// The source must live as long as this.
class BorrowedSource : public crypto::ByteSource {
 public:
  explicit BorrowedSource(const crypto::ByteSource& source) : source_(source) {}
  [[nodiscard]] std::uint64_t size() const override { return source_.size(); }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    return source_.read_at(offset, into);
  }

 private:
  const crypto::ByteSource& source_;
};

}  // namespace kiroku::media
