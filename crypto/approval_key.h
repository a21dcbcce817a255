// An ECDSA key on P-256 in a file, by which somebody approves states of a device's boot: of the algorithms
// that TPMs verify, every TPM 2.0 of the PC Client profile has this one (Ed25519 none). Const members are
// thread-safe.
#pragma once

#include <string_view>

#include "base/bytes.h"
#include "crypto/hardware_key.h"
#include "crypto/openssl_handles.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

class ApprovalKey {
 public:
  static ApprovalKey generate();
  /// PKCS#8 as PEM. `passphrase` may be null for a plain one. kiroku::Error for another key, a wrong
  /// passphrase, or what is no key.
  static ApprovalKey from_pem(std::string_view pem, const Secret* passphrase);
  /// Encrypted when a passphrase is given (crypto/pkcs8.h).
  [[nodiscard]] Secret to_pem(const Secret* passphrase) const;
  [[nodiscard]] P256PublicKey public_key() const;
  /// ECDSA over SHA-256 of the message, DER; kiroku::Error if OpenSSL fails.
  [[nodiscard]] Bytes sign(ByteView message) const;

 private:
  explicit ApprovalKey(PrivateKey key);
  PrivateKey key_;
};

}  // namespace kiroku::crypto
