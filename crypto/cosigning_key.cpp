#include "crypto/cosigning_key.h"

#include <utility>

#include "base/error.h"
#include "crypto/pkcs8.h"

namespace kiroku::crypto {

CosigningKey::CosigningKey(SigningKey key) : key_(std::move(key)) {}

CosigningKey::CosigningKey(MlDsaPrivateKey key) : key_(std::move(key)) {
  if (std::get<MlDsaPrivateKey>(key_).set() != MlDsaSet::k44)
    throw UsageError("a witness signs by Ed25519 or ML-DSA-44 alone");
}

CosigningKey CosigningKey::generate(CosignatureAlgorithm algorithm) {
  if (algorithm == CosignatureAlgorithm::kEd25519) return CosigningKey(SigningKey::generate());
  return CosigningKey(MlDsaPrivateKey::generate(MlDsaSet::k44));
}

CosigningKey CosigningKey::from_pem(std::string_view pem) {
  if (auto key = ml_dsa_of_pem(MlDsaSet::k44, pem, nullptr)) return CosigningKey(std::move(*key));
  return CosigningKey(SigningKey::from_pem(pem, nullptr));
}

Secret CosigningKey::to_pem() const {
  if (const auto* key = std::get_if<SigningKey>(&key_)) return key->to_pem(nullptr);
  return ml_dsa_pem(std::get<MlDsaPrivateKey>(key_), nullptr);
}

CosignerKey CosigningKey::public_key(const std::string& name) const {
  if (const auto* key = std::get_if<SigningKey>(&key_)) return {name, key->public_key()};
  return CosignerKey::of_ml_dsa_44(name, std::get<MlDsaPrivateKey>(key_).public_key());
}

std::string CosigningKey::cosign(std::string_view text, const std::string& name, std::uint64_t time_s) const {
  return std::visit([&](const auto& key) { return crypto::cosign(text, name, key, time_s); }, key_);
}

}  // namespace kiroku::crypto
