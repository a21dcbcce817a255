// Sizes of the age v1 format (C2SP age, "payload") that checks without a key need. Functions are thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "crypto/age_file.h"

namespace kiroku::archive {

inline constexpr std::uint64_t kAgeChunkBytes = 64U << 10U;  // of plaintext
inline constexpr std::uint64_t kAgeTagBytes = 16;            // after each chunk
inline constexpr std::uint64_t kAgeNonceBytes = 16;          // between header and first chunk
/// Headers of more recipients than that are not looked at.
inline constexpr std::size_t kMaximumAgeHeaderBytes = 64U << 10U;
/// How every age v1 file begins.
inline constexpr std::string_view kAgeFirstLine = "age-encryption.org/v1\n";
/// An excerpt's original header beside a re-keyed segment: NAME.header.
inline constexpr std::string_view kOriginalHeaderSuffix = ".header";

/// The header text, up to and with the line "--- <MAC>"; nothing if the file does not begin with one. Throws
/// kiroku::IoError.
std::optional<Bytes> age_header_text(const crypto::ByteSource& file);
/// Length of the header text, up to and with the line "--- <MAC>"; nothing if the file does not begin with
/// one. Throws kiroku::IoError.
std::optional<std::uint64_t> age_header_bytes(const crypto::ByteSource& file);
/// Whether a text that age_header_text() gave is a header as anybody can see it: a stanza follows the first
/// line, and the last line has a MAC.
bool is_age_header(std::string_view text);
/// How much a file has of the form of an age file, as anybody sees without a key. What is in it, or whether
/// anybody can open it, nobody sees.
enum class AgeForm {
  kNone,
  kBegun,   // a header, its nonce, and bytes behind them: of a file that was cut off, perhaps
  kEmpty,   // sealed to its end, with nothing in it
  kHolding  // sealed to its end: behind the nonce chunks, the last of which holds something
};
/// Throws kiroku::IoError.
AgeForm age_form(const crypto::ByteSource& file);

}  // namespace kiroku::archive
