// Sealing and opening age v1 files (C2SP age): header with recipient stanzas, HKDF-SHA-256 payload key,
// ChaCha20-Poly1305 STREAM in 64 KiB chunks. Constant memory. Objects are not thread-safe unless stated.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "base/bytes.h"
#include "crypto/age_error.h"
#include "crypto/age_recipient.h"
#include "crypto/age_stream.h"
#include "crypto/byte_source.h"

namespace kiroku::crypto {

/// Seals a stream of plaintext; ciphertext leaves through the sink: first the header and payload nonce as one
/// call, then each chunk as it fills. Chunks that lie whole in a caller's span are sealed from there without
/// a copy, so large writes are the fastest.
class AgeSealer {
 public:
  /// Writes header and payload nonce at once. Throws kiroku::UsageError if `recipients` is empty, or has one
  /// that must be alone and is not.
  AgeSealer(const AgeRecipients& recipients, ByteSink sink);
  AgeSealer(AgeSealer&&) noexcept;
  AgeSealer& operator=(AgeSealer&&) noexcept;
  ~AgeSealer();
  void write(ByteView plaintext);
  /// Seals the last chunk; the file is invalid without it. Nothing may be written after.
  void finish();

 private:
  std::unique_ptr<AgeStreamWriter> payload_;
};

/// What to do where the file ends early.
enum class Truncation {
  kRefuse,   // AgeFailure::kTruncated
  kTolerate  // readable up to the first chunk that does not authenticate; is_truncated() tells
};

/// An opened age file: plaintext by offset. All members are thread-safe.
class AgeFile {
 public:
  /// Reads the header and checks its MAC; throws AgeError, kiroku::IoError. With Truncation::kRefuse the last
  /// chunk is authenticated too, so that plaintext_size() is proven. `source` must outlive the object.
  static AgeFile open(const ByteSource& source, const AgeIdentities& identities,
                      Truncation truncation = Truncation::kRefuse);
  AgeFile(AgeFile&&) noexcept;
  AgeFile& operator=(AgeFile&&) noexcept;
  ~AgeFile();

  [[nodiscard]] std::uint64_t plaintext_size() const;
  [[nodiscard]] std::uint64_t header_size() const;  // bytes of header text, before the payload nonce
  [[nodiscard]] bool is_truncated() const;
  /// Bytes of the file behind the last chunk that can be read; 0 unless is_truncated().
  [[nodiscard]] std::uint64_t unreadable_size() const;
  /// Decrypts [offset, offset + into.size()); returns how many bytes there were (fewer only at the end). The
  /// newest chunk read in part is kept, so that small reads in order decrypt nothing twice.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const;
  /// The whole plaintext in order, decrypted ahead by `threads` threads beside the calling one, which calls
  /// the sink; with 1 the calling thread does everything. Only authenticated plaintext leaves. Throws
  /// AgeError at the first bad chunk, after all before it have left.
  void read_all(const ByteSink& sink, unsigned threads = 1) const;
  /// Writes the whole plaintext to an empty regular file opened for writing, several threads each reading,
  /// decrypting and writing (pwrite) parts of it: the fastest way from file to file. `name` stands in errors;
  /// `progress` may be empty, and is called by one thread at a time. Throws AgeError at the first bad chunk;
  /// then the file has been cut to the plaintext before it. Throws kiroku::IoError; then what the file holds
  /// is undefined.
  void write_to(int file_descriptor, const std::filesystem::path& name, const ByteProgress& progress,
                unsigned threads) const;

  struct State;

 private:
  explicit AgeFile(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Opens from a pipe: one pass, constant memory; `read` fills a buffer and returns 0 at the end. Plaintext
/// leaves chunk by chunk, so a caller must be ready for an AgeError after some of it.
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
/// one film). `other_header` must be a header and nothing more; throws AgeError (kHeaderMalformed) otherwise,
/// and as unseal_stream does for the header of `source`.
bool same_file_key(const ByteSource& source, ByteView other_header, const AgeIdentities& identities);

}  // namespace kiroku::crypto
