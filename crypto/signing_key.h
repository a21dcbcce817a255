// Ed25519 (RFC 8032) keys of a device, with the ML-DSA-65 key (FIPS 204) and the key in hardware that sign
// beside. Immutable after construction; safe from several threads.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.h"
#include "crypto/hardware_key.h"
#include "crypto/ml_dsa.h"
#include "crypto/openssl_handles.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

using Ed25519PublicKey = std::array<std::byte, 32>;
using Ed25519Signature = std::array<std::byte, 64>;

bool verify_ed25519(const Ed25519PublicKey& key, ByteView message, ByteView signature);

/// A private signing key. Move-only.
class SigningKey {
 public:
  static SigningKey generate();
  /// PKCS#8 PEM (RFC 5958), plain or encrypted; throws kiroku::Error if it is none, of another algorithm, or
  /// the passphrase is wrong. `passphrase` is null for a plain key; an encrypted one then is refused with a
  /// message that says so.
  static SigningKey from_pem(std::string_view pem, const Secret* passphrase);
  [[nodiscard]] static bool pem_is_encrypted(std::string_view pem);
  /// PKCS#8 PEM, encrypted (PBES2, AES-256-CBC, PBKDF2) when a passphrase is given.
  [[nodiscard]] Secret to_pem(const Secret* passphrase) const;

  [[nodiscard]] Ed25519PublicKey public_key() const;
  [[nodiscard]] Ed25519Signature sign(ByteView message) const;

  /// The key of a device that signs with both from now on; kiroku::UsageError for another set than ML-DSA-65.
  [[nodiscard]] SigningKey with_ml_dsa(MlDsaPrivateKey key) &&;
  /// Null if the device has none.
  [[nodiscard]] const MlDsaPrivateKey* ml_dsa() const { return ml_dsa_ ? &*ml_dsa_ : nullptr; }

  /// The key of a device whose hardware signs, too, from now on. `signer` is not null.
  [[nodiscard]] SigningKey with_hardware(std::shared_ptr<const HardwareSigner> signer) &&;
  /// Null if the device has none.
  [[nodiscard]] const HardwareSigner* hardware() const { return hardware_.get(); }

 private:
  explicit SigningKey(PrivateKey key);
  PrivateKey key_;
  std::optional<MlDsaPrivateKey> ml_dsa_;
  std::shared_ptr<const HardwareSigner> hardware_;
};

}  // namespace kiroku::crypto
