// The public identity of a device that signs with two keys: a C2SP signed note that either of them signs, so
// that neither can be exchanged for another device's. Functions are pure and thread-safe.
//
// Its text has four lines:
//   kiroku/<device>/identity
//   the Ed25519 key     <device>+<key id>+<base64>
//   the ML-DSA-65 key   <device>/ml-dsa-65+<key id>+<base64>
//   how many entries the appliance log had when the device began to sign with both; 0: it always did
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "crypto/signed_note.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

/// Whether a text begins as such an identity does; not whether it is one.
bool looks_like_device_identity(std::string_view text);
/// `key` has both halves (kiroku::UsageError otherwise).
std::string write_device_identity(const std::string& device, const SigningKey& key, std::uint64_t since);
/// A key that has both halves. Throws kiroku::UsageError naming what is wrong with the identity.
VerifierKey parse_device_identity(std::string_view note);

}  // namespace kiroku::crypto
