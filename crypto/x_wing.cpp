#include "crypto/x_wing.h"

#include <cstring>

#include "base/error.h"
#include "crypto/keccak.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kLabel = "\\.//^\\";

Secret expand(ByteView seed) {
  if (seed.size() != kXWingSeedSize) throw UsageError("an X-Wing key is made from a seed of 32 bytes");
  Secret expanded(kMlKemSeedSize + kX25519KeySize);
  keccak(Keccak::kShake256, {seed}, expanded.bytes());
  return expanded;
}

X25519PublicKey last_part(ByteView bytes) {
  X25519PublicKey key;
  std::memcpy(key.data(), bytes.last(key.size()).data(), key.size());
  return key;
}

Secret combine(const Secret& ml_kem, const Secret& x25519_secret, const X25519PublicKey& share,
               const X25519PublicKey& recipient) {
  Secret shared(32);
  keccak(Keccak::kSha3With256Bits,
         {ml_kem.bytes(), x25519_secret.bytes(), share, recipient, bytes_of(kLabel)}, shared.bytes());
  return shared;
}

}  // namespace

XWingPrivateKey::XWingPrivateKey(ByteView seed) : XWingPrivateKey(expand(seed)) {}

XWingPrivateKey::XWingPrivateKey(const Secret& expanded)
    : ml_kem_(expanded.bytes().first(kMlKemSeedSize)),
      x25519_key_(Secret::copy_of(expanded.bytes().last(kX25519KeySize))),
      x25519_public_(x25519_public_key(x25519_key_.bytes())) {}

Bytes XWingPrivateKey::public_key() const {
  Bytes result = ml_kem_.public_key();
  append(result, x25519_public_);
  return result;
}

std::optional<Secret> XWingPrivateKey::decapsulate(ByteView ciphertext) const {
  if (ciphertext.size() != kXWingCiphertextSize) throw UsageError("an X-Wing ciphertext has 1120 bytes");
  const X25519PublicKey share = last_part(ciphertext);
  const auto x25519_secret = x25519(x25519_key_.bytes(), share);
  if (!x25519_secret) return std::nullopt;
  const Secret ml_kem_secret = ml_kem_.decapsulate(ciphertext.first(kMlKemCiphertextSize));
  return combine(ml_kem_secret, *x25519_secret, share, x25519_public_);
}

bool is_x_wing_public_key(ByteView bytes) {
  return bytes.size() == kXWingPublicKeySize && is_ml_kem_public_key(bytes.first(kMlKemPublicKeySize));
}

XWingEncapsulation x_wing_encapsulate(ByteView public_key, const Secret& randomness) {
  if (!is_x_wing_public_key(public_key)) throw UsageError("this is no X-Wing public key");
  if (randomness.size() != kMlKemMessageSize + kX25519KeySize)
    throw UsageError("an X-Wing encapsulation takes 64 random bytes");
  const X25519PublicKey recipient = last_part(public_key);
  const ByteView ephemeral = randomness.bytes().last(kX25519KeySize);
  const X25519PublicKey share = x25519_public_key(ephemeral);
  const auto x25519_secret = x25519(ephemeral, recipient);
  if (!x25519_secret) throw UsageError("this X-Wing public key has an X25519 half of low order");
  auto ml_kem = ml_kem_encapsulate(public_key.first(kMlKemPublicKeySize),
                                   Secret::copy_of(randomness.bytes().first(kMlKemMessageSize)));
  append(ml_kem.ciphertext, share);
  return {std::move(ml_kem.ciphertext), combine(ml_kem.shared_secret, *x25519_secret, share, recipient)};
}

}  // namespace kiroku::crypto
