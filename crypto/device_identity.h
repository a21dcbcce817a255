// The public identity of a device that signs with several keys: a C2SP signed note that each of them signs,
// so that none can be exchanged for another device's. Functions are thread-safe.
//
// Its text begins with two lines:
//   kiroku/<device>/identity
//   the Ed25519 key     <device>+<key id>+<base64>
// Two lines follow for each key that signs beside, ML-DSA-65 first, at least one:
//   the key             <device>/ml-dsa-65+<key id>+<base64> or <device>/ecdsa-p256+<key id>+<base64>
//   how many entries the appliance log had when the device began to sign with it; 0: it always did. Of the
//   key in hardware, unless it is 0, a space and the base64 of the log's root at that size follow.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/hash.h"
#include "crypto/signed_note.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

/// Whether a text begins as such an identity does; not whether it is one.
bool looks_like_device_identity(std::string_view text);
/// Since when the device signs with the keys beside Ed25519; of a key that it does not have, nothing counts.
struct SignsSince {
  std::uint64_t ml_dsa = 0, hardware = 0;
  /// The log's root at `hardware` entries, unless that is 0.
  std::optional<Sha256Digest> log_root_before_hardware = std::nullopt;
};
/// `key` has at least one key beside Ed25519 (kiroku::UsageError otherwise, and for a size without its root).
/// kiroku::Error where the hardware does not sign.
std::string write_device_identity(const std::string& device, const SigningKey& key, SignsSince since);
/// A key with all that it states. Throws kiroku::UsageError naming what is wrong with the identity.
VerifierKey parse_device_identity(std::string_view note);

}  // namespace kiroku::crypto
