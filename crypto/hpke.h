// The key schedule of HPKE (RFC 9180 section 5.1) in base mode with HKDF-SHA-256 and ChaCha20-Poly1305, for a
// shared secret that any KEM has agreed on. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

/// For the first (and here only) message; its nonce is the base nonce.
struct HpkeKeys {
  Secret key;    // 32 bytes
  Secret nonce;  // 12 bytes
};
HpkeKeys hpke_base_keys(std::uint16_t kem, const Secret& shared_secret, std::string_view info);

}  // namespace kiroku::crypto
