// Text encodings. Pure functions, thread-safe. Decoders are strict: what an encoder would not have written is
// refused.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/bytes.h"

namespace kiroku::crypto {

std::string to_hex(ByteView bytes);                    // lower case
std::optional<Bytes> from_hex(std::string_view text);  // lower case only, even length

enum class Base64Padding { kPadded, kUnpadded };
/// RFC 4648 section 4, one line.
std::string to_base64(ByteView bytes, Base64Padding padding);
/// Nothing for wrong padding, line breaks, foreign characters, or non-zero trailing bits.
std::optional<Bytes> from_base64(std::string_view text, Base64Padding padding);

/// Bech32 (BIP 173) without its 90-character limit, as age uses it. `human_part` in lower case gives a
/// lower-case string, in upper case an upper-case one.
std::string to_bech32(std::string_view human_part, ByteView bytes);
struct Bech32 {
  std::string human_part;
  Bytes bytes;
};
/// Nothing for mixed case, a wrong checksum or non-zero padding bits.
std::optional<Bech32> from_bech32(std::string_view text);

}  // namespace kiroku::crypto
