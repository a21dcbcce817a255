// The private key of a witness, of either algorithm that cosigns. Immutable after construction; safe from
// several threads. Move-only.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "crypto/cosignature.h"
#include "crypto/ml_dsa.h"
#include "crypto/secret.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

class CosigningKey {
 public:
  explicit CosigningKey(SigningKey key);
  /// kiroku::UsageError for another set than ML-DSA-44.
  explicit CosigningKey(MlDsaPrivateKey key);
  static CosigningKey generate(CosignatureAlgorithm algorithm);
  /// Plain PKCS#8 PEM: of Ed25519 (RFC 8410), or of ML-DSA-44 as its seed alone (RFC 9881). kiroku::Error if
  /// it is none.
  static CosigningKey from_pem(std::string_view pem);
  [[nodiscard]] Secret to_pem() const;

  [[nodiscard]] CosignerKey public_key(const std::string& name) const;
  /// As cosign().
  [[nodiscard]] std::string cosign(std::string_view text, const std::string& name,
                                   std::uint64_t time_s) const;

 private:
  std::variant<SigningKey, MlDsaPrivateKey> key_;
};

}  // namespace kiroku::crypto
