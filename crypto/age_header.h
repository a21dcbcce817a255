// The textual header of an age v1 file (C2SP age, "Header"): reading, writing, and its MAC. It knows nothing
// of what stanzas contain. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/bytes.h"
#include "crypto/age_error.h"
#include "crypto/age_recipient.h"
#include "crypto/hash.h"

namespace kiroku::crypto {

/// Longest header read here; age itself has no limit. A hybrid stanza has 1.6 kB, so there is room for
/// hundreds of recipients.
inline constexpr std::size_t kMaximumAgeHeaderSize = 1 << 20;

struct AgeHeader {
  std::vector<AgeStanza> stanzas;
  Sha256Digest mac{};
  Bytes authenticated_text;  // what the MAC is over: up to and including "---"
  std::size_t size = 0;      // bytes of the whole header, with the last newline
};

/// The header at the front of `bytes`, which may go on behind it. Nothing if `bytes` ends within a header
/// that is well formed so far. Throws AgeError (kArmored, kHeaderMalformed); an scrypt stanza beside another
/// one is malformed, too.
std::optional<AgeHeader> parse_age_header(ByteView bytes);

/// Whether `file_key` fits the header's MAC.
bool age_header_mac_fits(const AgeHeader& header, const Secret& file_key);

/// The whole header text for these stanzas, with its MAC.
Bytes write_age_header(const std::vector<AgeStanza>& stanzas, const Secret& file_key);

}  // namespace kiroku::crypto
