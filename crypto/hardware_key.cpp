#include "crypto/hardware_key.h"

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <utility>

#include <openssl/ec.h>
#include <openssl/ecdsa.h>
#include <openssl/x509.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

using BigNumber = std::unique_ptr<BIGNUM, OpenSslDeleter<BN_free>>;
using EcdsaSignature = std::unique_ptr<ECDSA_SIG, OpenSslDeleter<ECDSA_SIG_free>>;

constexpr std::size_t kCoordinateSize = 32;

/// SubjectPublicKeyInfo of id-ecPublicKey and prime256v1, up to the point's two coordinates (RFC 5480).
constexpr std::array<unsigned char, 27> kBeforePoint{0x30, 0x59, 0x30, 0x13, 0x06, 0x07, 0x2a, 0x86, 0x48,
                                                     0xce, 0x3d, 0x02, 0x01, 0x06, 0x08, 0x2a, 0x86, 0x48,
                                                     0xce, 0x3d, 0x03, 0x01, 0x07, 0x03, 0x42, 0x00, 0x04};

/// Null if the bytes are no such key.
PrivateKey public_key_of(ByteView der) {
  const bool has_form = der.size() == kBeforePoint.size() + 2 * kCoordinateSize &&
                        std::equal(kBeforePoint.begin(), kBeforePoint.end(), openssl_bytes(der));
  if (!has_form) return nullptr;
  const unsigned char* at = openssl_bytes(der);
  PrivateKey key(d2i_PUBKEY(nullptr, &at, static_cast<long>(der.size())));
  if (!key) last_openssl_error();
  return key;
}

}  // namespace

P256PublicKey p256_public_key(ByteView x, ByteView y) {
  if (auto key = p256_point(x, y)) return std::move(*key);
  throw Error("a key that was given is no point of the curve P-256");
}

std::optional<P256PublicKey> p256_point(ByteView x, ByteView y) {
  P256PublicKey key = to_bytes(std::as_bytes(std::span(kBeforePoint)));
  for (const ByteView coordinate : {x, y}) {
    if (coordinate.size() > kCoordinateSize) return std::nullopt;
    key.resize(key.size() + kCoordinateSize - coordinate.size());
    append(key, coordinate);
  }
  if (!is_p256_public_key(key)) return std::nullopt;
  return key;
}

bool is_p256_public_key(ByteView key) { return public_key_of(key) != nullptr; }

bool verify_ecdsa_p256(ByteView public_key, ByteView message, ByteView signature) {
  const PrivateKey key = public_key_of(public_key);
  const DigestContext context(EVP_MD_CTX_new());
  if (!key || !context) return false;
  const bool valid = EVP_DigestVerifyInit(context.get(), nullptr, EVP_sha256(), nullptr, key.get()) == 1 &&
                     EVP_DigestVerify(context.get(), openssl_bytes(signature), signature.size(),
                                      openssl_bytes(message), message.size()) == 1;
  if (!valid) last_openssl_error();  // a refused signature is an answer
  return valid;
}

Bytes ecdsa_signature(ByteView r, ByteView s) {
  const auto number = [](ByteView bytes) {
    return BigNumber(BN_bin2bn(openssl_bytes(bytes), static_cast<int>(bytes.size()), nullptr));
  };
  BigNumber first = number(r);
  BigNumber second = number(s);
  const EcdsaSignature signature(ECDSA_SIG_new());
  if (!first || !second || !signature || ECDSA_SIG_set0(signature.get(), first.get(), second.get()) != 1)
    throw Error("cannot write an ECDSA signature: OpenSSL reports " + last_openssl_error());
  static_cast<void>(first.release());
  static_cast<void>(second.release());
  const int size = i2d_ECDSA_SIG(signature.get(), nullptr);
  if (size <= 0) throw Error("cannot write an ECDSA signature: OpenSSL reports " + last_openssl_error());
  Bytes der(static_cast<std::size_t>(size));
  unsigned char* at = openssl_bytes(std::span<std::byte>(der));
  i2d_ECDSA_SIG(signature.get(), &at);
  return der;
}

std::string why_silent(const HardwareSigner& signer) {
  constexpr std::string_view kText = "kiroku\n";
  HardwareSigner::Answer answer = signer.sign(bytes_of(kText));
  if (answer.signature.empty()) return std::move(answer.why);
  return verify_ecdsa_p256(signer.public_key(), bytes_of(kText), answer.signature)
             ? std::string()
             : "its signature does not fit the key that it is known by";
}

}  // namespace kiroku::crypto
