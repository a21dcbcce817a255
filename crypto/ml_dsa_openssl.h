// ML-DSA (FIPS 204) of libcrypto, which has it from OpenSSL 3.5 on: Debian 13. Names are given to OpenSSL as
// text, so this compiles with the headers of Debian 12, too, and a program built there uses a newer
// libcrypto.
//
// Sizes are the caller's to check (crypto/ml_dsa.h does). What OpenSSL refuses is a kiroku::Error. Functions
// are thread-safe.
#pragma once

#include "base/bytes.h"
#include "crypto/ml_dsa.h"

namespace kiroku::crypto::ml_dsa_openssl {

/// Whether the libcrypto that runs, as its configuration file sets it up, offers ML-DSA-44 and ML-DSA-65.
/// Asked once.
bool is_available();

/// As crypto/ml_dsa.h has them; only where is_available().
Bytes public_key_of(MlDsaSet set, ByteView seed);
Bytes sign(MlDsaSet set, ByteView seed, ByteView randomness, ByteView message, ByteView context);
bool verify(MlDsaSet set, ByteView public_key, ByteView message, ByteView signature, ByteView context);

}  // namespace kiroku::crypto::ml_dsa_openssl
