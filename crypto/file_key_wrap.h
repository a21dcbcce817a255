// Wrapping an age file's key under a derived key: ChaCha20-Poly1305 with a zero nonce (C2SP age; each wrap
// key is used once). Shared by the recipient types. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>

#include "base/bytes.h"
#include "crypto/aead.h"
#include "crypto/age_recipient.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::size_t kWrappedFileKeySize = kFileKeySize + kAeadTagSize;

Bytes wrap_file_key(const Secret& wrap_key, const Secret& file_key);
/// Nothing if `body` was not made with this key. Its size must have been checked: opening bodies of other
/// sizes would let a sender test many keys with one file (partitioning oracle).
std::optional<Secret> unwrap_file_key(const Secret& wrap_key, ByteView body);

/// What every recipient type demands of its stanzas; throws AgeError (kHeaderMalformed) that names the type.
void require_stanza(bool condition, const AgeStanza& stanza, const std::string& what);

}  // namespace kiroku::crypto
