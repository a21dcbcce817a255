// X25519 (RFC 7748) over OpenSSL. Pure functions, thread-safe.
#pragma once

#include <array>
#include <optional>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::size_t kX25519KeySize = 32;
using X25519PublicKey = std::array<std::byte, kX25519KeySize>;

/// The public key of a 32-byte private key (which is clamped as the RFC says).
X25519PublicKey x25519_public_key(ByteView private_key);

/// The shared secret; nothing if `share` is a point of low order, whose secret would be all zeros whoever the
/// recipient is.
std::optional<Secret> x25519(ByteView private_key, const X25519PublicKey& share);

}  // namespace kiroku::crypto
