// HKDF (RFC 5869), HMAC (RFC 2104) with SHA-256 and scrypt (RFC 7914), over OpenSSL. Pure functions,
// thread-safe. All throw kiroku::Error if OpenSSL fails.
#pragma once

#include <string_view>

#include "base/bytes.h"
#include "crypto/hash.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

/// HKDF-Extract and -Expand to 32 bytes; `salt` may be empty.
Secret hkdf_sha256(ByteView input_key, ByteView salt, std::string_view info);

Sha256Digest hmac_sha256(ByteView key, ByteView message);

/// 32 bytes with N = 2^log2_n, r = 8, p = 1. Takes 1024·N bytes of memory while it runs.
Secret scrypt(ByteView passphrase, ByteView salt, int log2_n);

}  // namespace kiroku::crypto
