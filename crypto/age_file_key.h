// From an age header and identities to keys, and from recipients to a header: what sealing, opening and
// re-keying share. Pure functions, thread-safe.
#pragma once

#include "base/bytes.h"
#include "crypto/age_header.h"
#include "crypto/age_recipient.h"
#include "crypto/age_stream.h"
#include "crypto/byte_source.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::size_t kAgePayloadNonceSize = 16;

/// The header at the front of `source`. Throws AgeError (kArmored, kHeaderMalformed).
AgeHeader read_age_header(const ByteSource& source);
/// The same from a stream; `rest` receives what was read beyond the header.
AgeHeader read_age_header(const ByteReader& read, Bytes& rest);

/// The file key, once it has satisfied the header's MAC. Throws AgeError (kNoMatch, kHeaderForged,
/// kHeaderMalformed), and kiroku::UsageError if there are no identities.
Secret unwrap_file_key(const AgeHeader& header, const AgeIdentities& identities);
/// A header that wraps `file_key` for all `recipients`. Throws kiroku::UsageError if there are none, or one
/// that must be alone is not.
Bytes wrap_file_key(const Secret& file_key, const AgeRecipients& recipients);

/// HKDF of file key and payload nonce.
Secret age_payload_key(const Secret& file_key, ByteView payload_nonce);

}  // namespace kiroku::crypto
