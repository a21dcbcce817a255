// Where sealed statements of consent and scanned forms lie beside the appliance log, and how much they may be
// (docs/reference/format-recovery.md, "Consent"). Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/hash.h"

namespace kiroku::archive {

/// In the folder of the log.
inline constexpr std::string_view kConsentsFolder = "consents";
/// Purposes that one consent names.
inline constexpr std::size_t kMaximumPurposes = 32;
/// A sealed file: what is longer is not read.
inline constexpr std::uint64_t kMaximumConsentBytes = std::uint64_t{64} << 20U;

/// "consents/<64 lower-case hexadecimal digits>.age", by the SHA-256 of the sealed file itself.
std::string consent_path(const crypto::Sha256Digest& sha256);
/// The hash of such a path; nothing for any other.
std::optional<crypto::Sha256Digest> hash_of_consent_path(std::string_view path);

}  // namespace kiroku::archive
