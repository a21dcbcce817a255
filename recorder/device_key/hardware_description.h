// Where a device's key in hardware is: what device-hardware.json of a home says. It holds no secret.
// Functions are thread-safe.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "crypto/hardware_key.h"

namespace kiroku::recorder {

struct HardwareDescription {
  enum class Kind { kTpm, kPkcs11 };
  Kind kind = Kind::kTpm;
  std::string address;  // TCTI or PKCS#11 URI
  Bytes key;            // of a TPM the template's `unique`, of a token the key's CKA_ID
  crypto::P256PublicKey public_key;
  /// TPMT_PUBLIC of the TPM's attestation key; empty if it has none that this home uses, and for a token.
  Bytes attestation_key = {};

  [[nodiscard]] std::string to_json() const;
  /// Throws kiroku::Error naming what is wrong.
  static HardwareDescription parse(std::string_view json);
};

/// Has the hardware make a new key; kiroku::Error where it does not.
HardwareDescription make_hardware_key(HardwareDescription::Kind kind, const std::string& address);
/// The attestation key of the TPM that has this key; kiroku::Error where the TPM does not quote by it, or for
/// a token.
Bytes find_attestation_key(const HardwareDescription& description);
/// What signs by it, and quotes if there is an attestation key. Nothing is asked of the hardware before the
/// first signature.
std::shared_ptr<const crypto::HardwareSigner> hardware_signer(const HardwareDescription& description);

}  // namespace kiroku::recorder
