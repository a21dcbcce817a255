#include "crypto/ml_dsa.h"

#include <string>

#include "base/error.h"
#include "crypto/ml_dsa_openssl.h"
#include "crypto/ml_dsa_own.h"

namespace kiroku::crypto {
namespace {

void require_size(MlDsaSet set, ByteView bytes, std::size_t size, const char* what) {
  if (bytes.size() != size)
    throw UsageError(std::string(ml_dsa_name(set)) + " was called with " + what + " not of " +
                     std::to_string(size) + " bytes");
}

}  // namespace

MlDsaProvider ml_dsa_provider() {
  return ml_dsa_openssl::is_available() ? MlDsaProvider::kOpenSsl : MlDsaProvider::kOwn;
}

MlDsaPrivateKey::MlDsaPrivateKey(MlDsaSet set, ByteView seed, MlDsaProvider provider)
    : set_(set), provider_(provider) {
  require_size(set, seed, kMlDsaSeedSize, "a seed");
  seed_ = Secret::copy_of(seed);
  if (provider == MlDsaProvider::kOpenSsl) {
    public_key_ = ml_dsa_openssl::public_key_of(set, seed);
    return;
  }
  ml_dsa_own::Keys keys = ml_dsa_own::generate(set, seed);
  public_key_ = std::move(keys.public_key);
  expanded_ = std::move(keys.private_key);
}

MlDsaPrivateKey MlDsaPrivateKey::generate(MlDsaSet set) {
  return {set, Secret::random(kMlDsaSeedSize).bytes()};
}

Bytes MlDsaPrivateKey::sign(ByteView message, ByteView context) const {
  return sign_with(Secret::random(kMlDsaRandomnessSize).bytes(), message, context);
}

Bytes MlDsaPrivateKey::sign_deterministically(ByteView message, ByteView context) const {
  return sign_with(Secret(kMlDsaRandomnessSize).bytes(), message, context);
}

Bytes MlDsaPrivateKey::sign_with(ByteView randomness, ByteView message, ByteView context) const {
  require_size(set_, randomness, kMlDsaRandomnessSize, "randomness");
  if (context.size() > kMlDsaLongestContext)
    throw UsageError(std::string(ml_dsa_name(set_)) + " was called with a context of " +
                     std::to_string(context.size()) + " bytes; 255 is the most");
  if (provider_ == MlDsaProvider::kOpenSsl)
    return ml_dsa_openssl::sign(set_, seed_.bytes(), randomness, message, context);
  return ml_dsa_own::sign(set_, expanded_.bytes(), ml_dsa_own::representative(public_key_, message, context),
                          randomness);
}

bool verify_ml_dsa(MlDsaSet set, ByteView public_key, ByteView message, ByteView signature, ByteView context,
                   MlDsaProvider provider) {
  if (public_key.size() != ml_dsa_public_key_size(set) || signature.size() != ml_dsa_signature_size(set) ||
      context.size() > kMlDsaLongestContext)
    return false;
  if (provider == MlDsaProvider::kOpenSsl)
    return ml_dsa_openssl::verify(set, public_key, message, signature, context);
  return ml_dsa_own::verify(set, public_key, ml_dsa_own::representative(public_key, message, context),
                            signature);
}

}  // namespace kiroku::crypto
