// ML-DSA (FIPS 204) where libcrypto has none: with the OpenSSL of Debian 12. Keccak is OpenSSL's.
//
// Time and memory addresses depend on public values only: no branch, table or division is taken on a secret.
// Signing tries until a signature tells nothing of the key. How often it tries, and the challenge of each
// try, are public, as in FIPS 204's own design: neither depends on the key. Secrets are zeroised. Sizes are
// the caller's to check (crypto/ml_dsa.h does), but for that of a private key. Functions are thread-safe.
#pragma once

#include "base/bytes.h"
#include "crypto/ml_dsa.h"
#include "crypto/secret.h"

namespace kiroku::crypto::ml_dsa_own {

struct Keys {
  Bytes public_key;
  Secret private_key;  // ρ, K, tr, s1, s2, t0: 2560 and 4032 bytes
};
/// ML-DSA.KeyGen_internal (Algorithm 6).
Keys generate(MlDsaSet set, ByteView seed);

/// μ: 64 bytes that stand for the message in its context (Algorithms 2 and 7).
inline constexpr std::size_t kRepresentativeSize = 64;
Bytes representative(ByteView public_key, ByteView message, ByteView context);

/// ML-DSA.Sign_internal (Algorithm 7) of a representative. kiroku::UsageError for a private key of another
/// length, or with values that no key has (Algorithm 25).
Bytes sign(MlDsaSet set, ByteView private_key, ByteView representative, ByteView randomness);
/// ML-DSA.Verify_internal (Algorithm 8).
bool verify(MlDsaSet set, ByteView public_key, ByteView representative, ByteView signature);

}  // namespace kiroku::crypto::ml_dsa_own
