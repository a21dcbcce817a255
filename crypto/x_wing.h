// X-Wing, the hybrid of ML-KEM-768 and X25519 (draft-connolly-cfrg-xwing-kem; MLKEM768-X25519 of
// draft-ietf-hpke-pq): safe as long as one of the two is. Functions and const members are thread-safe.
#pragma once

#include <optional>

#include "base/bytes.h"
#include "crypto/ml_kem.h"
#include "crypto/secret.h"
#include "crypto/x25519.h"

namespace kiroku::crypto {

inline constexpr std::size_t kXWingSeedSize = 32;
inline constexpr std::size_t kXWingPublicKeySize = kMlKemPublicKeySize + kX25519KeySize;
inline constexpr std::size_t kXWingCiphertextSize = kMlKemCiphertextSize + kX25519KeySize;

/// Both private keys, from one seed. Move-only.
class XWingPrivateKey {
 public:
  /// `seed` has kXWingSeedSize bytes.
  explicit XWingPrivateKey(ByteView seed);
  [[nodiscard]] Bytes public_key() const;
  /// The shared secret; for a ciphertext made for another key, a useless one. Nothing if the X25519 share is
  /// of low order. `ciphertext` has kXWingCiphertextSize bytes.
  [[nodiscard]] std::optional<Secret> decapsulate(ByteView ciphertext) const;

 private:
  explicit XWingPrivateKey(const Secret& expanded);

  MlKemPrivateKey ml_kem_;
  Secret x25519_key_;
  X25519PublicKey x25519_public_;
};

struct XWingEncapsulation {
  Bytes ciphertext;
  Secret shared_secret;
};
bool is_x_wing_public_key(ByteView bytes);
/// Throws kiroku::UsageError if the key is not a valid one, or its X25519 half is of low order. `randomness`
/// has 64 bytes: ML-KEM's message and the ephemeral X25519 key.
XWingEncapsulation x_wing_encapsulate(ByteView public_key, const Secret& randomness);

}  // namespace kiroku::crypto
