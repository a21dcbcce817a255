// ML-DSA (FIPS 204), signatures that quantum computers are not known to forge, in the parameter sets
// ML-DSA-44 and ML-DSA-65. OpenSSL's where the libcrypto that runs has it (3.5, Debian 13), else the
// project's own (3.0, Debian 12); both give the same bytes. Who computes is decided as for ML-KEM
// (crypto/ml_kem.h).
//
// Messages are signed whole ("pure" ML-DSA, no pre-hash). Secrets are zeroised. Functions and const members
// are thread-safe.
#pragma once

#include <cstddef>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

enum class MlDsaSet { k44, k65 };

inline constexpr std::size_t kMlDsaSeedSize = 32;        // ξ of FIPS 204
inline constexpr std::size_t kMlDsaRandomnessSize = 32;  // rnd of FIPS 204
inline constexpr std::size_t kMlDsaLongestContext = 255;

/// In bytes: 1312 and 1952.
constexpr std::size_t ml_dsa_public_key_size(MlDsaSet set) { return set == MlDsaSet::k44 ? 1312 : 1952; }
/// In bytes: 2420 and 3309.
constexpr std::size_t ml_dsa_signature_size(MlDsaSet set) { return set == MlDsaSet::k44 ? 2420 : 3309; }
/// "ML-DSA-44" and "ML-DSA-65".
constexpr const char* ml_dsa_name(MlDsaSet set) { return set == MlDsaSet::k44 ? "ML-DSA-44" : "ML-DSA-65"; }

enum class MlDsaProvider { kOwn, kOpenSsl };
/// Who computes unless it is said: OpenSSL where it offers both sets.
MlDsaProvider ml_dsa_provider();

/// A signing key: its seed, and what is expanded of it. Move-only.
class MlDsaPrivateKey {
 public:
  /// ML-DSA.KeyGen_internal; `seed` has kMlDsaSeedSize bytes (kiroku::UsageError otherwise).
  MlDsaPrivateKey(MlDsaSet set, ByteView seed, MlDsaProvider provider = ml_dsa_provider());
  static MlDsaPrivateKey generate(MlDsaSet set);
  [[nodiscard]] MlDsaSet set() const { return set_; }
  [[nodiscard]] const Secret& seed() const { return seed_; }
  [[nodiscard]] const Bytes& public_key() const { return public_key_; }

  /// ML-DSA.Sign, hedged: with fresh random bytes. `context` has at most kMlDsaLongestContext bytes
  /// (kiroku::UsageError); a signature holds in its context alone.
  [[nodiscard]] Bytes sign(ByteView message, ByteView context = {}) const;
  /// The deterministic variant: the same bytes each time.
  [[nodiscard]] Bytes sign_deterministically(ByteView message, ByteView context = {}) const;
  /// With the kMlDsaRandomnessSize bytes given (kiroku::UsageError).
  [[nodiscard]] Bytes sign_with(ByteView randomness, ByteView message, ByteView context = {}) const;

 private:
  MlDsaSet set_;
  MlDsaProvider provider_;
  Secret seed_;
  Secret expanded_;  // of the own implementation: FIPS 204's private key
  Bytes public_key_;
};

/// ML-DSA.Verify. Keys and signatures of a wrong length, and contexts that are too long, are not valid ones.
bool verify_ml_dsa(MlDsaSet set, ByteView public_key, ByteView message, ByteView signature,
                   ByteView context = {}, MlDsaProvider provider = ml_dsa_provider());

}  // namespace kiroku::crypto
