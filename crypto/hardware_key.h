// ECDSA signatures on P-256 (FIPS 186-5) over SHA-256, by a key that its hardware does not give away: a
// TPM 2.0 or a PKCS#11 token. Here is how such a key is asked and its signatures are checked; what speaks
// with the hardware is recorder/device_key. Functions and const members are thread-safe.
#pragma once

#include <optional>
#include <string>

#include "base/bytes.h"

namespace kiroku::crypto {

class BootAttester;  // crypto/tpm_quote.h

/// A public key on P-256 as DER SubjectPublicKeyInfo (RFC 5480), 91 bytes.
using P256PublicKey = Bytes;

/// The same point as DER. `x` and `y` are big endian, of at most 32 bytes. kiroku::Error if it is not on the
/// curve.
P256PublicKey p256_public_key(ByteView x, ByteView y);
/// The same; nothing if there is no such point.
std::optional<P256PublicKey> p256_point(ByteView x, ByteView y);
/// Whether the bytes are such a key: on P-256, with a named curve and an uncompressed point, and no other
/// DER.
bool is_p256_public_key(ByteView key);
/// `signature` is DER (RFC 3279, Ecdsa-Sig-Value). What is no key or no signature is not valid.
bool verify_ecdsa_p256(ByteView public_key, ByteView message, ByteView signature);
/// `r` and `s`, big endian, as DER; kiroku::Error if OpenSSL fails.
Bytes ecdsa_signature(ByteView r, ByteView s);

/// What asks the hardware. Implementations are thread-safe.
class HardwareSigner {
 public:
  HardwareSigner() = default;
  HardwareSigner(const HardwareSigner&) = delete;
  HardwareSigner& operator=(const HardwareSigner&) = delete;
  virtual ~HardwareSigner() = default;
  /// Known without asking the hardware.
  [[nodiscard]] virtual const P256PublicKey& public_key() const = 0;
  struct Answer {
    Bytes signature;  // DER; empty if there is none
    std::string why;  // one sentence if there is none
  };
  /// Signs SHA-256 of the message. Waits a bounded time, and never throws for what the hardware does.
  [[nodiscard]] virtual Answer sign(ByteView message) const = 0;
  /// What quotes the measured boot, in the same hardware; null if it cannot.
  [[nodiscard]] virtual const BootAttester* attester() const { return nullptr; }
};

/// Has the hardware sign a text that is no note, and checks that by the key it is known by. Why it does not
/// sign now, one sentence; empty if it does.
std::string why_silent(const HardwareSigner& signer);

}  // namespace kiroku::crypto
