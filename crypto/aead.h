// ChaCha20-Poly1305 (RFC 8439), the one authenticated cipher of age files. An object holds one key and may be
// used for many messages; it is not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "base/bytes.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {

inline constexpr std::size_t kAeadKeySize = 32;
inline constexpr std::size_t kAeadNonceSize = 12;
inline constexpr std::size_t kAeadTagSize = 16;

/// Seals and opens messages under one key. The key schedule is kept between messages; only the nonce is set
/// anew, because setting up a context for each 64 KiB chunk costs measurably. The two directions have a
/// context each, made at the first use.
class ChaCha20Poly1305 {
 public:
  /// `key` has kAeadKeySize bytes; throws kiroku::UsageError for any other size.
  explicit ChaCha20Poly1305(ByteView key);
  ~ChaCha20Poly1305();
  ChaCha20Poly1305(ChaCha20Poly1305&&) noexcept = default;
  ChaCha20Poly1305& operator=(ChaCha20Poly1305&&) noexcept = default;

  /// Writes ciphertext and tag. `sealed` has plaintext.size() + kAeadTagSize bytes and does not overlap
  /// `plaintext`, or begins where it begins. A nonce must never be used twice with one key. Throws
  /// kiroku::UsageError for wrong sizes.
  void seal(ByteView nonce, ByteView plaintext, std::span<std::byte> sealed, ByteView associated_data = {});
  /// Whether `sealed` is authentic; then `plaintext` (sealed.size() - kAeadTagSize bytes, overlap as above)
  /// has been written, otherwise it is zeroised. Throws kiroku::UsageError for a nonce or plaintext of wrong
  /// size.
  [[nodiscard]] bool open(ByteView nonce, ByteView sealed, std::span<std::byte> plaintext,
                          ByteView associated_data = {});

 private:
  CipherContext context(bool sealing) const;

  std::array<std::byte, kAeadKeySize> key_;
  CipherContext seal_context_;
  CipherContext open_context_;
};

}  // namespace kiroku::crypto
