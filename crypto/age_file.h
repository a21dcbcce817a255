// Sealing and opening age v1 files (C2SP age): header with recipient stanzas, HKDF-SHA-256 payload key,
// ChaCha20-Poly1305 STREAM in 64 KiB chunks. Constant memory. Objects are not thread-safe unless stated.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/bytes.h"
#include "base/error.h"
#include "crypto/age_recipient.h"

namespace kiroku::crypto {

/// Why an age file was refused; each kind of damage has its own.
enum class AgeFailure {
  kArmored,          // ASCII armor: not read here, use `age -d` or strip it
  kHeaderMalformed,  // not an age header, or not as the specification demands
  kHeaderForged,     // header MAC does not fit the file key
  kNoMatch,          // none of the identities is a recipient
  kPayloadDamaged,   // a chunk does not authenticate (wrong bytes, order, or a false last chunk)
  kTruncated,        // ends before the last chunk
  kTrailingData,     // goes on after the last chunk
};

class AgeError : public Error {
 public:
  AgeError(AgeFailure failure, const std::string& message) : Error(message), failure_(failure) {}
  [[nodiscard]] AgeFailure failure() const { return failure_; }

 private:
  AgeFailure failure_;
};

/// Receives bytes in order. May throw; the thrower's error then stays (every later call fails the same way).
using ByteSink = std::function<void(ByteView)>;

/// Seals a stream of plaintext; ciphertext leaves through the sink: first the header, then each chunk as it
/// fills.
class AgeSealer {
 public:
  /// Writes header and payload nonce at once. `recipients` must not be empty.
  AgeSealer(const AgeRecipients& recipients, ByteSink sink);
  AgeSealer(AgeSealer&&) noexcept;
  ~AgeSealer();
  void write(ByteView plaintext);
  /// Seals the last chunk; the file is invalid without it. Nothing may be written after.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Random-access bytes; implementations must allow read_at from several threads at once.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// Fills `into` from `offset` on; fewer bytes only at the end. Throws kiroku::IoError.
  virtual std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const = 0;
};
/// A file opened for reading.
std::unique_ptr<ByteSource> open_file_source(const std::filesystem::path& file);
/// Bytes in memory, which must outlive the source.
std::unique_ptr<ByteSource> memory_source(ByteView bytes);

/// What to do where the file ends early.
enum class Truncation {
  kRefuse,   // AgeFailure::kTruncated
  kTolerate  // readable up to the last whole chunk that authenticates; is_truncated() tells
};

/// An opened age file: plaintext by offset. read_at is thread-safe.
class AgeFile {
 public:
  /// Reads the header and checks its MAC; throws AgeError, kiroku::IoError. With Truncation::kRefuse the last
  /// chunk is authenticated too, so that plaintext_size() is proven. `source` must outlive the object.
  static AgeFile open(const ByteSource& source, const AgeIdentities& identities,
                      Truncation truncation = Truncation::kRefuse);
  AgeFile(AgeFile&&) noexcept;
  ~AgeFile();

  [[nodiscard]] std::uint64_t plaintext_size() const;
  [[nodiscard]] std::uint64_t header_size() const;  // bytes of header text, before the payload nonce
  [[nodiscard]] bool is_truncated() const;
  /// Decrypts [offset, offset + into.size()); returns how many bytes there were (fewer only at the end).
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const;
  /// The whole plaintext in order, decrypted by up to `threads` threads; the sink is called from the calling
  /// thread. Only authenticated plaintext leaves. Throws AgeError at the first bad chunk, after all before it
  /// have left.
  void read_all(const ByteSink& sink, unsigned threads = 1) const;

 private:
  struct State;
  explicit AgeFile(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Opens from a pipe: one pass, constant memory; `read` fills a buffer and returns 0 at the end.
using ByteReader = std::function<std::size_t(std::span<std::byte>)>;
void unseal_stream(const ByteReader& read, const AgeIdentities& identities, const ByteSink& sink);

/// Small files at once.
Bytes seal_bytes(ByteView plaintext, const AgeRecipients& recipients);
Bytes unseal_bytes(ByteView sealed, const AgeIdentities& identities);

/// The header alone, for re-keying (an excerpt for a new reader): unwraps the file key with `identities` and
/// writes a new header for `recipients` over the same payload. Returns the new header text; `old_header_size`
/// receives the old one's length.
Bytes rekey_header(const ByteSource& source, const AgeIdentities& identities, const AgeRecipients& recipients,
                   std::uint64_t& old_header_size);
/// Whether the file key that opens `source` also satisfies the MAC of `other_header` (so that both commit to
/// one film).
bool same_file_key(const ByteSource& source, ByteView other_header, const AgeIdentities& identities);

}  // namespace kiroku::crypto
