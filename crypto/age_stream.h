// The payload of an age v1 file (C2SP age, "Payload"): chunks of 64 KiB, each sealed with ChaCha20-Poly1305
// under a nonce of its number and whether it is the last. It knows the payload key, not where that came from.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <optional>

#include "base/bytes.h"
#include "crypto/aead.h"

namespace kiroku::crypto {

inline constexpr std::size_t kAgeChunkSize = 64 * 1024;
inline constexpr std::size_t kSealedAgeChunkSize = kAgeChunkSize + kAeadTagSize;

/// Receives bytes in order. May throw; the thrower's error then stays (every later call fails the same way).
using ByteSink = std::function<void(ByteView)>;
/// Told how many bytes are done.
using ByteProgress = std::function<void(std::uint64_t)>;
/// Fills a buffer and returns how much; 0 at the end.
using ByteReader = std::function<std::size_t(std::span<std::byte>)>;

/// Where chunks lie in a payload of known size.
struct AgePayloadLayout {
  std::uint64_t chunks = 0;            // also the begun one at the end; 0 only for an empty payload
  std::uint64_t last_sealed_size = 0;  // sealed bytes of the last chunk
  /// Room for a tag, and not empty unless it is the only one.
  [[nodiscard]] bool last_chunk_is_possible() const;
};
AgePayloadLayout age_payload_layout(std::uint64_t payload_size);

enum class ChunkPosition { kInside, kLast };

/// Seals and opens single chunks. Not thread-safe: a thread makes its own.
class AgeChunkCipher {
 public:
  /// `payload_key` has 32 bytes.
  explicit AgeChunkCipher(ByteView payload_key) : cipher_(payload_key) {}
  void seal(std::uint64_t number, ChunkPosition position, ByteView plaintext, std::span<std::byte> sealed);
  [[nodiscard]] bool open(std::uint64_t number, ChunkPosition position, ByteView sealed,
                          std::span<std::byte> plaintext);

 private:
  ChaCha20Poly1305 cipher_;
};

/// Cuts plaintext into chunks and seals them; each leaves through the sink as one call. Not thread-safe.
class AgeStreamWriter {
 public:
  AgeStreamWriter(ByteView payload_key, ByteSink sink);
  ~AgeStreamWriter();
  void write(ByteView plaintext);
  void finish();

 private:
  void seal_chunk(ChunkPosition position, ByteView plaintext);
  void guarded(const std::function<void()>& action);

  AgeChunkCipher cipher_;
  ByteSink sink_;
  std::uint64_t next_number_ = 0;
  Bytes held_;  // plaintext of the chunk that may yet become the last one
  std::size_t held_size_ = 0;
  Bytes sealed_;
  bool finished_ = false;
  std::exception_ptr error_;
};

/// Opens a payload from its first byte to its last in one pass; plaintext leaves through the sink chunk by
/// chunk, only authenticated. Throws AgeError (kPayloadDamaged, kTruncated, kTrailingData) after all
/// plaintext before the damage has left.
void open_age_stream(ByteView payload_key, const ByteReader& read, const ByteSink& sink);

/// Fills `into` from `read` as far as there is data; returns how far.
std::size_t read_fully(const ByteReader& read, std::span<std::byte> into);

}  // namespace kiroku::crypto
