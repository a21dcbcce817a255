// ML-KEM-768 (FIPS 203) where libcrypto has none: with the OpenSSL of Debian 12. Keccak is OpenSSL's.
//
// Time and memory addresses depend on public values only (public key, ciphertext length), never on keys,
// messages or whether a ciphertext is valid: no branch, table or division is taken on a secret. Secrets are
// zeroised. Sizes are the caller's to check (crypto/ml_kem.h does). Functions are thread-safe.
#pragma once

#include "base/bytes.h"
#include "crypto/ml_kem.h"
#include "crypto/secret.h"

namespace kiroku::crypto::ml_kem_own {

/// ML-KEM.KeyGen_internal (Algorithm 16), the encapsulation key of it.
Bytes public_key_of(ByteView seed);
/// ML-KEM.Decaps_internal (Algorithm 18); `public_key` is that of `seed`.
Secret decapsulate(ByteView seed, ByteView public_key, ByteView ciphertext);
/// ML-KEM.Encaps_internal (Algorithm 17); `public_key` is a valid one.
MlKemEncapsulation encapsulate(ByteView public_key, ByteView message);

}  // namespace kiroku::crypto::ml_kem_own
