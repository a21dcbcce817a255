// ML-KEM-768 (FIPS 203), a key encapsulation that quantum computers are not known to break. OpenSSL's where
// the libcrypto that runs has it (3.5, Debian 13), else the project's own (3.0, Debian 12); both give the
// same bytes.
//
// Which one is decided when the program runs, not when it is built: libcrypto.so.3 is the same library by
// name in both releases, and the machine's openssl.cnf says which algorithms it offers. Secrets are zeroised.
// Functions and const members are thread-safe.
#pragma once

#include <cstddef>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::size_t kMlKemSeedSize = 64;  // d and z of FIPS 203
inline constexpr std::size_t kMlKemPublicKeySize = 1184;
inline constexpr std::size_t kMlKemCiphertextSize = 1088;
inline constexpr std::size_t kMlKemSharedSize = 32;
inline constexpr std::size_t kMlKemMessageSize = 32;

enum class MlKemProvider { kOwn, kOpenSsl };
/// Who computes unless it is said: OpenSSL where it offers ML-KEM-768, as its code is read and attacked by
/// more people.
MlKemProvider ml_kem_provider();

/// A decapsulation key, kept as its seed and expanded when used. Move-only.
class MlKemPrivateKey {
 public:
  /// ML-KEM.KeyGen_internal; `seed` has kMlKemSeedSize bytes (kiroku::UsageError otherwise).
  explicit MlKemPrivateKey(ByteView seed, MlKemProvider provider = ml_kem_provider());
  [[nodiscard]] const Bytes& public_key() const { return public_key_; }
  /// ML-KEM.Decaps: always gives a secret; for a ciphertext that was not made for this key, one that nobody
  /// else can compute ("implicit rejection"). `ciphertext` has kMlKemCiphertextSize bytes
  /// (kiroku::UsageError).
  [[nodiscard]] Secret decapsulate(ByteView ciphertext) const;

 private:
  MlKemProvider provider_;
  Secret seed_;
  Bytes public_key_;
};

/// Length and the modulus check of FIPS 203 section 7.2.
bool is_ml_kem_public_key(ByteView bytes);

struct MlKemEncapsulation {
  Bytes ciphertext;
  Secret shared_secret;
};
/// ML-KEM.Encaps_internal with the random `message` (kMlKemMessageSize bytes) given. Throws
/// kiroku::UsageError if the key is not a valid one.
MlKemEncapsulation ml_kem_encapsulate(ByteView public_key, const Secret& message,
                                      MlKemProvider provider = ml_kem_provider());

}  // namespace kiroku::crypto
