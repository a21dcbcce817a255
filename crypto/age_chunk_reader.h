// Chunks of an opened age file by number: the shared, immutable facts of the file, and a reader that each
// thread has for itself.
#pragma once

#include <cstdint>

#include "base/bytes.h"
#include "crypto/age_stream.h"
#include "crypto/byte_source.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

/// What is known of the payload. Immutable while readers exist, so safe to share.
struct AgePayload {
  const ByteSource* source = nullptr;
  Secret key;
  std::uint64_t offset = 0;            // of the first chunk in the source
  std::uint64_t chunks = 0;            // readable ones
  std::uint64_t last_sealed_size = 0;  // of the last readable one
  bool ends_with_last_chunk = true;    // false where a truncated file is tolerated

  [[nodiscard]] std::uint64_t sealed_size(std::uint64_t number) const {
    return number + 1 == chunks ? last_sealed_size : kSealedAgeChunkSize;
  }
  [[nodiscard]] std::uint64_t offset_of(std::uint64_t number) const {
    return offset + number * kSealedAgeChunkSize;
  }
  [[nodiscard]] std::uint64_t plaintext_size() const {
    return chunks == 0 ? 0 : (chunks - 1) * kAgeChunkSize + last_sealed_size - kAeadTagSize;
  }
  [[nodiscard]] ChunkPosition position_of(std::uint64_t number) const {
    return number + 1 == chunks && ends_with_last_chunk ? ChunkPosition::kLast : ChunkPosition::kInside;
  }
};

/// Reads, authenticates and decrypts runs of chunks. Not thread-safe.
class AgeChunkReader {
 public:
  /// `payload` must outlive the reader. Memory is taken at the first read: as much as the longest run needs.
  explicit AgeChunkReader(const AgePayload& payload);

  /// How many bytes of plaintext the chunks [first, first + count) hold.
  [[nodiscard]] std::size_t plaintext_size(std::uint64_t first, std::uint64_t count) const;
  /// Decrypts the chunks [first, first + count) into `plaintext`, which has plaintext_size() bytes. At the
  /// first bad chunk it throws AgeError; `authentic_size` then tells how many bytes before it are good.
  void read(std::uint64_t first, std::uint64_t count, std::span<std::byte> plaintext,
            std::size_t& authentic_size);

  /// Whether a chunk authenticates in a position; for finding out where a damaged file ends.
  [[nodiscard]] bool authenticates(std::uint64_t number, std::uint64_t sealed_size, ChunkPosition position);

 private:
  std::span<std::byte> sealed_buffer(std::size_t size);
  [[noreturn]] void refuse(std::uint64_t number, ByteView sealed);

  const AgePayload& payload_;
  AgeChunkCipher cipher_;
  Bytes sealed_;
  Bytes scratch_;
};

}  // namespace kiroku::crypto
