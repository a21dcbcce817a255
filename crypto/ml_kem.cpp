#include "crypto/ml_kem.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "crypto/ml_kem_openssl.h"
#include "crypto/ml_kem_own.h"
#include "crypto/ml_kem_polynomial.h"

namespace kiroku::crypto {
namespace {

void require_size(ByteView bytes, std::size_t size, const char* what) {
  if (bytes.size() != size)
    throw UsageError(std::string("ML-KEM-768 was called with a ") + what + " that has not " +
                     std::to_string(size) + " bytes");
}

}  // namespace

MlKemProvider ml_kem_provider() {
  return ml_kem_openssl::is_available() ? MlKemProvider::kOpenSsl : MlKemProvider::kOwn;
}

MlKemPrivateKey::MlKemPrivateKey(ByteView seed, MlKemProvider provider) : provider_(provider) {
  require_size(seed, kMlKemSeedSize, "seed");
  seed_ = Secret::copy_of(seed);
  public_key_ = provider == MlKemProvider::kOpenSsl ? ml_kem_openssl::public_key_of(seed)
                                                    : ml_kem_own::public_key_of(seed);
}

Secret MlKemPrivateKey::decapsulate(ByteView ciphertext) const {
  require_size(ciphertext, kMlKemCiphertextSize, "ciphertext");
  return provider_ == MlKemProvider::kOpenSsl
             ? ml_kem_openssl::decapsulate(seed_.bytes(), ciphertext)
             : ml_kem_own::decapsulate(seed_.bytes(), public_key_, ciphertext);
}

bool is_ml_kem_public_key(ByteView bytes) {
  if (bytes.size() != kMlKemPublicKeySize) return false;
  constexpr unsigned kBits = 12;
  constexpr std::size_t kEncodedSize = kMlKemDegree * kBits / 8;
  // What is left after the polynomials is a seed, of which every value is valid.
  for (; bytes.size() >= kEncodedSize; bytes = bytes.subspan(kEncodedSize)) {
    const ByteView encoded = bytes.first(kEncodedSize);
    Bytes again(kEncodedSize);
    encode_polynomial(decode_polynomial(encoded, kBits), kBits, again);
    if (!std::ranges::equal(encoded, again)) return false;
  }
  return true;
}

MlKemEncapsulation ml_kem_encapsulate(ByteView public_key, const Secret& message, MlKemProvider provider) {
  if (!is_ml_kem_public_key(public_key)) throw UsageError("this is no ML-KEM-768 public key");
  require_size(message.bytes(), kMlKemMessageSize, "message");
  return provider == MlKemProvider::kOpenSsl ? ml_kem_openssl::encapsulate(public_key, message.bytes())
                                             : ml_kem_own::encapsulate(public_key, message.bytes());
}

}  // namespace kiroku::crypto
