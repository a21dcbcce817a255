// ML-KEM-768 (FIPS 203) of libcrypto, which has it from OpenSSL 3.5 on: Debian 13. Names are given to OpenSSL
// as text, so this compiles with the headers of Debian 12, too, and a program built there uses a newer
// libcrypto.
//
// Sizes are the caller's to check (crypto/ml_kem.h does). What OpenSSL refuses is a kiroku::Error. Functions
// are thread-safe.
#pragma once

#include "base/bytes.h"
#include "crypto/ml_kem.h"
#include "crypto/secret.h"

namespace kiroku::crypto::ml_kem_openssl {

/// Whether the libcrypto that runs, as its configuration file sets it up, offers ML-KEM-768. Asked once.
bool is_available();

/// As the functions of crypto/ml_kem_own.h, whose bytes they give; only where is_available().
Bytes public_key_of(ByteView seed);
Secret decapsulate(ByteView seed, ByteView ciphertext);
MlKemEncapsulation encapsulate(ByteView public_key, ByteView message);

}  // namespace kiroku::crypto::ml_kem_openssl
